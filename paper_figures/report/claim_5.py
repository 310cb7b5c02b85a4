"""Claim 5: the number of actions makes little difference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from paper_figures.report.markdown import count, percent, table
from paper_figures.report.study_tables import Missing, Results, command
from paper_figures.report.verdict import Check, Claim, Part
from paper_figures.rows import ACTIONS, SAMPLES

SEED = 0  # the one that all numbers of actions have
KEYS = ["truth", "cells", "dt"]


@dataclass(frozen=True)
class Measure:
    """A column of `summary`, and what a little difference in it is.

    Attributes:
        name: the column.
        words: what a reader calls it.
        relative: whether its change is a share of the value with 9 actions.
        little: the largest change that counts as little.
        spell: the change as text.
    """

    name: str
    words: str
    relative: bool
    little: float
    spell: Callable[[float], str]

    def change(self, pairs: pd.DataFrame) -> pd.Series:
        """From 9 actions to another number, of the columns `nine` and `other`."""
        if self.relative:
            return pairs["other"] / pairs["nine"] - 1
        return pairs["other"] - pairs["nine"]


MEASURES = (
    Measure("final_state_error", "final-state error", True, 0.1, percent),
    Measure("violation_distance", "violation distance", True, 0.1, percent),
    Measure("rank_after_9", "median rank after 9 demonstrations", False, 1, count),
    Measure("share_top_5_after_9", "share in the top 5 after 9", False, 0.1, percent),
)


def claim(results: Results) -> Claim:
    """Write claim 5.

    Raises:
        Missing: the study `paper` is not there yet.
    """
    names = [measure.name for measure in MEASURES]
    columns = (*KEYS, "actions", "samples", "seed", *names)
    summary = results.table("paper", "summary", columns)
    summary = summary[(summary["seed"] == SEED) & (summary["samples"] == SAMPLES)]
    others = sorted(set(summary["actions"]) - {ACTIONS})
    nine = summary[summary["actions"] == ACTIONS]
    if not others or nine.empty:
        raise Missing("paper", f"the study `paper` has no other number of actions than {ACTIONS}")
    if summary["rank_after_9"].isna().all():
        raise Missing("paper", "the study `paper` ranks nothing after 9 demonstrations")
    parts, changes = [], []
    for measure in MEASURES:
        pairs = (
            summary[summary["actions"].isin(others)][[*KEYS, "actions", measure.name]]
            .rename(columns={measure.name: "other"})
            .merge(nine[[*KEYS, measure.name]].rename(columns={measure.name: "nine"}), on=KEYS)
        )
        pairs["change"] = measure.change(pairs)
        pairs["holds"] = pairs["change"].abs() <= measure.little + 1e-12
        checks = [_check(row, measure) for _, row in pairs.iterrows()]
        little = measure.spell(measure.little)
        rule = f"within {little} of {ACTIONS} actions, for a truth, grid, dt and number of actions"
        parts.append(Part(measure.words, rule, checks))
        changes.append((measure, pairs))
    return Claim(
        title="Number of actions",
        paper="other numbers of actions than 9 make little difference to any of these measures.",
        parts=parts,
        numbers=_changes(changes, others),
        why=_where(changes, others),
        command=command("paper"),
    )


def _check(row: pd.Series, measure: Measure) -> Check:
    """Whether the number of actions makes little difference in one setting."""
    change = row["change"]
    sign = "+" if change > 0 else ""
    return Check(
        f"{row['actions']} actions, {row['truth'].upper()}, {row['cells']} cells, dt {row['dt']:g}",
        bool(row["holds"]),
        "no value" if pd.isna(change) else sign + measure.spell(change),
    )


def _changes(changes: list[tuple[Measure, pd.DataFrame]], others: list[int]) -> str:
    """Median and largest change of each measure by number of actions."""
    lines = []
    for measure, pairs in changes:
        for actions in others:
            values = pairs[pairs["actions"] == actions].dropna(subset="change")
            size = values["change"].abs()
            where = median = largest = "-"
            if len(values):
                worst = values.loc[size.idxmax()]
                where = f"{worst['truth'].upper()}, {worst['cells']} cells, dt {worst['dt']:g} s"
                median, largest = measure.spell(size.median()), measure.spell(size.max())
            lines.append([measure.words, actions, where, len(values), median, largest])
    return (
        f"Change from {ACTIONS} actions, over truths, grids and dt, on the same demonstrations "
        f"(seed {SEED}); of error and distance relative, of shares in points of a hundred.\n\n"
        + table(
            ["measure", "actions", "largest at", "settings", "median change", "largest"],
            lines,
            words=3,
        )
    )


def _where(changes: list[tuple[Measure, pd.DataFrame]], others: list[int]) -> str:
    """In how many settings the difference is little, by dt: too few actions for a long hold?"""
    both = pd.concat([pairs for _, pairs in changes]).dropna(subset="change")
    steps = sorted(both["dt"].unique())
    counts = both.groupby(["actions", "dt"])["holds"].agg(["sum", "size"])
    rows = [
        [
            f"{actions} actions",
            *(
                f"{counts.loc[(actions, dt), 'sum']} of {counts.loc[(actions, dt), 'size']}"
                for dt in steps
            ),
        ]
        for actions in others
    ]
    return (
        "Where the number of actions does matter is told by dt: settings with a value, of all four "
        "measures together, in which the difference is little.\n\n"
        + table(["", *(f"dt {dt:g} s" for dt in steps)], rows)
    )
