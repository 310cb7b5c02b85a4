"""The figure and the report's section of baselines, on made-up numbers."""

from __future__ import annotations

import pandas as pd
import pytest
from method_studies import baseline_differences

from paper_figures import baselines
from paper_figures.report import section_baselines
from paper_figures.report.study_tables import Results
from paper_figures.rows import Unsuited


def test_the_figure_has_a_curve_a_method() -> None:
    figure = baselines.draw(baseline_differences())
    for axes in figure.axes:
        assert len(axes.containers) == len(baselines.METHODS)
    assert "uniform: in the top 5 10 % (-60 % against ours)" in baselines.facts(
        baseline_differences()
    )
    with pytest.raises(Unsuited, match="differ in more than method"):
        baselines.draw(pd.concat([baseline_differences(), baseline_differences()]))


def test_the_section_says_where_ours_wins_and_where_not(tmp_path) -> None:  # type: ignore[no-untyped-def]
    results = Results(tmp_path)
    results.read["baselines", "baseline_differences"] = baseline_differences()
    text = section_baselines.section(results)
    assert "apart from 0: uniform (1, 9).\n" in text
    assert "Less often: nearest unvisited (1, 9).\n" in text
    assert "told from 0: the paper's evidence (1, 9); visitation difference (1, 9);" in text
    assert "| 9 | uniform | 10 % [0, 20 %] | -60 [-70, -50] | 1.49 | 0.55 [0.5, 0.61] |" in text
