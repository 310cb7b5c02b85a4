"""The figure and the report's section of many systems, on made-up numbers."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from dynamics_study import dynamics

from experiments.collate.success_rule import success_tables
from paper_figures import dynamics as figure_module
from paper_figures.report import section_dynamics
from paper_figures.report.study_tables import Missing, Results

MADE = success_tables(dynamics())
OF_FIGURE = {name: MADE[name] for name in figure_module.TABLES}


def test_the_figure_has_a_row_for_each_system_way_and_number() -> None:
    for name, columns in figure_module.TABLES.items():
        assert set(columns) <= set(MADE[name])
    figure = figure_module.draw(**OF_FIGURE)
    systems, scores, weights = figure.axes
    means = MADE["success_forecasts"].groupby("system")["top"].mean()
    best = systems.get_yticklabels()[0].get_text()
    assert means[best] == means.max()
    ways = [label.get_text().replace("\n", " ") for label in scores.get_yticklabels()]
    assert ways == [*figure_module.WAYS.values()]
    names = [label.get_text().replace("\n", " ") for label in weights.get_yticklabels()]
    assert names[:2] == ["simulated success", "reach of controls in a step"]
    plt.close(figure)
    row = MADE["success_scores"].set_index("way").loc["base_rate"]
    assert f"base rate: Brier score {row['brier']:.3f}; the rule's less this " in (
        figure_module.facts(**OF_FIGURE)
    )


def test_the_section_says_what_the_rule_is_worth(tmp_path: Path) -> None:
    results = Results(tmp_path)
    results.read.update({("dynamics", name): table for name, table in MADE.items()})
    text = section_dynamics.section(results)
    assert "40 points of 5 systems" in text
    assert "It is better than *base rate*" in text
    assert "reach of controls in a step +" in text
    assert text.count("| S") == len(MADE["success_systems"])
    # A rule that is worse must be called so.
    scores = MADE["success_scores"].copy()
    for end in ("", "_low", "_high"):
        scores[f"rule_less{end}"] = 0.1
    results.read["dynamics", "success_scores"] = scores
    assert "It is worse than *base rate*" in section_dynamics.section(results)
    with pytest.raises(Missing):
        section_dynamics.section(Results(tmp_path / "elsewhere"))
