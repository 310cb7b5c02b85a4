"""The figure and the report's section of baselines, on made-up numbers."""

from __future__ import annotations

import pandas as pd
import pytest

from paper_figures import baselines
from paper_figures.report import section_baselines
from paper_figures.report.study_tables import Results
from paper_figures.rows import Unsuited


def made_up() -> pd.DataFrame:
    """Ours wins against uniform, loses to the nearest, and is not told from the others."""
    less = {"ours": (0.0, 0.0, 0.0), "uniform": (-0.6, -0.7, -0.5), "nearest": (0.1, 0.05, 0.2)}
    rows = []
    for size in (1, 9):
        for method in baselines.METHODS:
            row = {"method": method, "demonstrations": size, "truths": 10, "points": 30}
            middle, low, high = less.get(method, (-0.1, -0.2, 0.1))
            for name, at in (("top", 0.7), ("log_rank", 1.0), ("rank", 3.0)):
                for end, value in (("", middle), ("_low", low), ("_high", high)):
                    row[f"{name}_less_ours{end}"] = value
                    row[f"{name}{end}"] = at + value
            rows.append(row)
    return pd.DataFrame(rows)


def test_the_figure_has_a_curve_a_method() -> None:
    figure = baselines.draw(made_up())
    for axes in figure.axes:
        assert len(axes.containers) == len(baselines.METHODS)
    assert "uniform: in the top 5 10 % (-60 % against ours)" in baselines.facts(made_up())
    with pytest.raises(Unsuited, match="differ in more than method"):
        baselines.draw(pd.concat([made_up(), made_up()]))


def test_the_section_says_where_ours_wins_and_where_not(tmp_path) -> None:  # type: ignore[no-untyped-def]
    results = Results(tmp_path)
    results.read["baselines", "baseline_differences"] = made_up()
    text = section_baselines.section(results)
    assert "apart from 0: uniform (1, 9).\n" in text
    assert "Less often: nearest unvisited (1, 9).\n" in text
    assert "told from 0: the paper's evidence (1, 9); visitation difference (1, 9);" in text
    assert "| 9 | uniform | 10 % [0, 20 %] | -60 [-70, -50] | 1.49 | 0.55 [0.5, 0.61] |" in text
