"""Arms and bodies without a grid: is the truth found, do forecasts come true, what does it cost?"""

from __future__ import annotations

import pandas as pd

from paper_figures import dimensions
from paper_figures.arms import (
    FIRST,
    TABLES,
    TARGET,
    among_first,
    forecast_rows,
    of_cases,
    worlds,
)
from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.means import Mean, share
from paper_figures.report.study_tables import Results

STUDY, COSTS = "arms", "dimensions"
_JOINTS, _WORLDS = "arm, six joints", 100  # the case that the target is of, and its worlds
_LIKELY = 0.5  # a posterior from which the most probable answer is a constraint


def section(results: Results) -> str:
    """Worlds by system, forecasts by bin, and the growth of time with each size.

    Raises:
        Missing: the study `arms` or the table of costs is not there yet.
    """
    models, scored, summary, cases = (
        results.table(STUDY, name, columns) for name, columns in TABLES.items()
    )
    costs = results.table(COSTS, "dimensions", dimensions.TABLES["dimensions"])
    rows, forecasts = worlds(models, summary, cases), of_cases(scored, cases)
    return (
        "Each world draws tasks at random, and as its truth one of the hypotheses, ranges of two "
        "joints at any speed, that at least a sixth of its tasks cross where nothing is forbidden, "
        "or, where none is crossed so often, of those that are crossed most. "
        "A demonstrator who brakes a joint in time, which needs no grid, does tasks that cross the "
        "truth, and the first five that are kept are what inference sees. It samples paths: there "
        "are no cells. Every world that ran counts, also those with fewer than five.\n\n"
        f"{_target(rows)}\n"
        + table(
            ["system", "worlds", "truth first", "in the first two", "fewer than five kept"],
            [_found(name, some) for name, some in rows.groupby("case", sort=False)],
        )
        + "\nPosterior probabilities, medians and means over worlds, and whether samples are to be "
        "believed:\n\n"
        + table(
            ["system", "of the truth", "claim of the first", "it is right", "doubted tasks"],
            [_believed(name, some) for name, some in rows.groupby("case", sort=False)],
        )
        + "\nForecasts of what demonstrators cross whom nothing constrains, for tasks that are not "
        "selected; intervals from worlds that are drawn again:\n\n"
        + "\n".join(
            f"{name}:\n\n{_forecasts(some)}" for name, some in forecasts.groupby("case", sort=False)
        )
        + "\nHow time grows, as powers of what grows:\n\n"
        + _growth(costs)
    )


def _target(rows: pd.DataFrame) -> str:
    """What is asked of the arm of six joints, and whether it holds."""
    some = rows[rows["case"] == _JOINTS]
    if not len(some):
        return "The arm of six joints has not run.\n"
    mean = among_first(some, FIRST[-1])
    verdict = "met" if mean.value >= TARGET else "missed"
    sure = "" if mean.low >= TARGET or mean.high < TARGET else ", though the interval holds both"
    return (
        f"Asked of six joints is the truth among the first two in {percent(TARGET)} of {_WORLDS} "
        f"worlds: it is in {_shares(mean)} of the {len(some)} that have run, so that the target is "
        f"{verdict}{sure}.\n"
    )


def _found(name: str, rows: pd.DataFrame) -> list[object]:
    """A line: how often the truth is among the first."""
    most = int(rows["demonstrations"].max())
    few = int((rows["demonstrations"] < most).sum())
    return [name, len(rows), *(_shares(among_first(rows, first)) for first in FIRST), few]


def _believed(name: str, rows: pd.DataFrame) -> list[object]:
    """A line: posteriors, whether a sure claim is right, and which samples are doubted."""
    sure = rows[rows["claim"] > _LIKELY]
    right = "-"
    if len(sure):
        right = f"{_shares(share(int((sure['rank'] == 1).sum()), len(sure)))} of {len(sure)}"
    doubted = share(int(rows["doubted"].sum()), int(rows["demonstrations"].sum()))
    claim = number(sure["claim"].mean())
    return [name, number(rows["posterior"].median()), claim, right, _shares(doubted)]


def _forecasts(scored: pd.DataFrame) -> str:
    """A line a bin."""
    lines = [
        [
            f"{row.lower:g} to {row.upper:g}",
            row.pairs,
            f"{row.forecast:.3f}",
            between(*(f"{value:.3f}" for value in (row.crossed, row.low, row.high))),
        ]
        for row in forecast_rows(scored.reset_index(drop=True))
        .rename(columns={"count": "pairs"})
        .itertuples()
    ]
    return table(["forecast", "pairs", "mean", "crossed"], lines)


def _growth(costs: pd.DataFrame) -> str:
    """A line a size."""
    lines = [
        [
            f"{row.factor}, {row.least} to {row.most}",
            *(f"{power:.2f}" for power in (row.draw, row.last, row.search, row.task)),
        ]
        for row in dimensions.slopes(costs).itertuples()
    ]
    head = ["what grows", "drawing paths", "at the end", "search for modes", "whole task"]
    return table(head, lines)


def _shares(mean: Mean) -> str:
    """A share with its interval, in percent."""
    return between(*(percent(value) for value in (mean.value, mean.low, mean.high)))
