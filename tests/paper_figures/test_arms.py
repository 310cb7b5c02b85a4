"""Worlds of arms and the cost of their tasks: tables of which every number is known."""

from pathlib import Path

import numpy as np
import pytest
from arm_study import arm_tables, dimension_tables
from scipy.stats import binomtest

from paper_figures import arms, dimensions
from paper_figures.report import section_arms
from paper_figures.report.study_tables import Missing, Results
from paper_figures.rows import Unsuited


def test_worlds_are_those_of_their_case() -> None:
    tables = arm_tables()
    rows = arms.worlds(*(tables[name] for name in ("models", "summary", "cases")))
    six = rows[rows["case"] == "arm, six joints"]
    assert sorted(six["rank"]) == [1.0] * 6 + [2.0] * 2 + [5.0] * 2
    assert six["demonstrations"].tolist() == [5] * 9 + [4]
    mean, peer = arms.among_first(six, 2), binomtest(8, 10).proportion_ci(method="wilson")
    np.testing.assert_allclose([mean.value, mean.low, mean.high], [0.8, *peer], atol=1e-4)
    with pytest.raises(Unsuited, match="not drawn"):
        arms.worlds(tables["models"].assign(truth="c1"), tables["summary"], tables["cases"])


def test_intervals_of_forecasts_are_over_worlds() -> None:
    """Pairs of a world go together: a bin that is crossed in 7 of 10 worlds is one of 10 cases."""
    scored = arm_tables()["scored"].iloc[:20].reset_index(drop=True)
    few, many = arms.forecast_rows(scored).to_dict("records")
    assert (few["low"], few["crossed"], few["high"]) == pytest.approx((0.1, 0.1, 0.1))
    assert (many["count"], many["forecast"], many["crossed"]) == (100, 0.75, 0.7)
    ends = np.quantile(np.random.default_rng(1).binomial(10, 0.7, 100_000) / 10, [0.025, 0.975])
    np.testing.assert_allclose([many["low"], many["high"]], ends, atol=0.11)


def test_slopes_are_those_of_the_table() -> None:
    table = dimension_tables()["dimensions"]
    found = dimensions.slopes(table).set_index("factor")
    np.testing.assert_allclose(found["draw"], [2.0, 1.0])
    np.testing.assert_allclose(found["last"], [2.0, 1.0])
    np.testing.assert_allclose(found["task"], 1.0)
    np.testing.assert_allclose(dimensions.grid_megabytes(table["value"][:2]), [8e-4, 0.08])


def test_captions_and_section_tell_the_numbers(tmp_path: Path) -> None:
    said = arms.facts(**arm_tables())
    assert "six joints: 10 worlds, 1 with fewer than 5 demonstrations; truth first in 60 %" in said
    said = dimensions.facts(**dimension_tables())
    assert "dimensions from 2 to 8: drawing grows with the power 2.00 (2.00 at the end)" in said
    assert "8 dimensions: 1.6 s and 200 MB; a grid 1e+08 cells" in said
    for study, tables in (("arms", arm_tables()), ("dimensions", dimension_tables())):
        folder = tmp_path / study / "tables"
        folder.mkdir(parents=True)
        for name, table in tables.items():
            table.to_csv(folder / f"{name}.csv", index=False)
    text = section_arms.section(Results(tmp_path))
    assert (
        "it is in 80 % [49, 94 %] of the 10 that have run, so that the target is met, though"
        in text
    )
    assert "| arm, six joints | 10 | 60 % [31, 83 %] | 80 % [49, 94 %] | 1 |" in text
    assert "| 0.5 to 1 | 100 | 0.750 | 0.700" in text
    assert "| samples, 1000 to 4000 | 1.00 | 1.00 |" in text
    with pytest.raises(Missing):
        section_arms.section(Results(tmp_path / "elsewhere"))
