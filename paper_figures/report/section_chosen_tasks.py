"""How many demonstrations are saved if tasks are chosen for what they are expected to teach."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from paper_figures.chosen_tasks import ALL, TABLES, counted_rows, title
from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Missing, Results

STUDY = "next_task"
TARGET = 0.5  # ratio of medians, chosen over random
_SOURCES = {"model": "drawn from the model", "demonstrator": "simulated demonstrator"}


def section(results: Results) -> str:
    """A line for each source and truth: demonstrations with chosen and random tasks, and ratios.

    Raises:
        Missing: the study `next_task` is not there yet.
    """
    rows = counted_rows(results.table(STUDY, "chosen_tasks", TABLES["chosen_tasks"]))
    if rows.empty:
        raise Missing(STUDY, f"the study `{STUDY}` has no truth to find")
    lines, longest = [], int(rows["longest"].max())
    for row in rows.itertuples():
        medians = [_limits(row, f"{way}_median", _count) for way in ("chosen", "random")]
        shares = f"{percent(row.chosen_share)}, {percent(row.random_share)}"
        ratios = [_limits(row, f"{name}_ratio", number) for name in ("median", "mean")]
        source, truth = _SOURCES[str(row.source)], title(str(row.truth))
        lines.append([source, truth, *medians, *ratios, shares])
    head = ["demonstrations", "truth", "median, chosen", "median, random", "ratio of medians"]
    head += [f"ratio of means up to {longest}", "found at all, chosen, random"]
    return (
        "Before each demonstration, the task of a random pool is chosen that promises most "
        "information about the constraint, given what was shown so far; or tasks come in random "
        "order. How many demonstrations does it take? Of those drawn from the tabular model under "
        "the truth, for which the paper's evidence is right, so many that the truth comes first "
        "with a posterior above 0.95. Of the simulated demonstrator's, with the calibrated "
        "evidence of `infer`, so many that the truth comes first and stays so until the last of "
        f"{longest}. Who has not found it by then is censored (Kaplan and Meier), and a median "
        "that is not met by then is *never*; a ratio to it is an upper bound.\n\n"
        f"{_verdict(rows)}\n" + table(head, lines, words=2)
    )


def _verdict(rows: pd.DataFrame) -> str:
    """Whether chosen tasks take half as many demonstrations drawn from the model, over all truths.

    The truths of one study are judged together; where there is only one, it stands for all.
    """
    lines = []
    for source, group in rows.groupby("source", sort=False):
        together = group[group["truth"] == ALL] if (group["truth"] == ALL).any() else group
        row = next(together.itertuples())
        ratio = _limits(row, "median_ratio", number)
        met = "met" if row.median_ratio <= TARGET else "not met"
        goal = f"; half as many was the aim, which is {met}" if source == "model" else ""
        lines.append(
            f"- {_SOURCES[str(source)].capitalize()}, {title(str(row.truth))}: a median of "
            f"{_limits(row, 'chosen_median', _count)} chosen tasks against "
            f"{_limits(row, 'random_median', _count)} random ones, a ratio of {ratio}{goal}.\n"
        )
    return "".join(lines)


def _limits(row: object, name: str, text: Callable[[float], str]) -> str:
    """A value with its interval."""
    return between(*(text(getattr(row, name + end)) for end in ("", "_low", "_high")))


def _count(value: float) -> str:
    """A number of demonstrations; a word where it is beyond the longest."""
    return "never" if not np.isfinite(value) else f"{value:g}"
