"""How the error of Phi falls with the number of cells, and whether varying cells do better."""

from __future__ import annotations

import pandas as pd

from paper_figures.cell_errors import KINDS, PANELS, TABLES, error_rows, slope
from paper_figures.report.markdown import between, number, table
from paper_figures.report.study_tables import Results

STUDY = "cells"
_MANY, _FEW = 1600, 400  # equal cells, and varying ones that are to do as well


def section(results: Results) -> str:
    """A table of errors for each reference, with the order of convergence.

    Raises:
        Missing: the study `cells` is not there yet.
    """
    rows = error_rows(results.table(STUDY, "resolution", TABLES["resolution"]))
    parts = [
        "Equal cells with moves from their centres, averaged over start points in a cell, or "
        "multilinear: shared among the cells around the end of a move. *Goals in the middle* are "
        "equal cells, averaged, but that each goal is in the middle of its cell. *Varying* cells "
        "begin so, and are halved where the tasks are likely to lead: those of a seed "
        "together, or each task on cells of its own. The error is the root mean "
        "square over hypotheses and tasks, with a 95 % interval over tasks; the order is the power "
        "of the number of cells with which it falls, and twice that in the width of a cell of two "
        "dimensions.",
        _target(rows),
    ]
    for reference, title in PANELS.items():
        parts.append(f"Error {title}:\n\n{_table(rows[rows['reference'] == reference])}")
    return "\n\n".join(parts)


def _target(rows: pd.DataFrame) -> str:
    """Whether few varying cells do as well as many equal ones, a line a reference."""
    lines = []
    for reference, title in PANELS.items():
        some = rows[rows["reference"] == reference]
        equal = some[some["kind"].isin(["centre", "averaged"])]
        near = equal[(equal["count"] / _MANY).between(0.9, 1.1)]
        for kind in ("varying", "of each task"):
            varying = some[(some["kind"] == kind) & (some["count"] <= _FEW)]
            if not len(near) or not len(varying):
                continue
            many, few = near.loc[near["error"].idxmin()], varying.loc[varying["error"].idxmin()]
            verdict = "met" if few["error"] <= many["error"] else "missed"
            lines.append(
                f"- {title}: {few['count']:.0f} cells, {KINDS[kind]}, err by {_error(few)}, "
                f"{many['count']:.0f} cells, {KINDS[many['kind']]}, by {_error(many)}; the "
                f"target, no larger an error, is {verdict}."
            )
    return "\n".join(lines)


def _table(rows: pd.DataFrame) -> str:
    """A line a kind, a column a number of cells that was asked for."""
    lines, levels = [], max(len(some) for _, some in rows.groupby("kind"))
    for kind, label in KINDS.items():
        some = rows[rows["kind"] == kind].sort_values("count")
        each = [f"{row['count']:.0f}: {_error(row)}" for _, row in some.iterrows()]
        order = slope(some)
        lines.append([label, *each, *[""] * (levels - len(each)), f"{order:.2f}"])
    return table(["cells", *[f"number {i + 1}" for i in range(levels)], "order"], lines, words=1)


def _error(row: pd.Series) -> str:
    """An error with its interval, and of how many tasks where some are not possible."""
    text = between(*(number(row[name]) for name in ("error", "low", "high")))
    lost = row["tasks"] - row["possible"]
    return f"{text}, {lost:.0f} of {row['tasks']:.0f} tasks not possible" if lost else text
