"""How the error of Phi falls with the number of cells, and whether varying cells do better."""

from __future__ import annotations

import numpy as np
import pandas as pd

from paper_figures.cell_errors import KINDS, PANELS, TABLES, error_rows, slope
from paper_figures.report.markdown import between, number, table
from paper_figures.report.study_tables import Results

# Equal cells, and varying ones that are to do as well.
_PENDULUM, _TELESCOPE = (1600, 400), (300_000, 60_000)


def section(results: Results) -> str:
    """A table of errors for each reference, with the order of convergence.

    Raises:
        Missing: the study `cells` is not there yet.
    """
    return _section(results, "cells", 2, *_PENDULUM)


def telescope_section(results: Results) -> str:
    """The same in four dimensions.

    Raises:
        Missing: the study `cells_telescope` is not there yet.
    """
    return _section(results, "cells_telescope", 4, *_TELESCOPE)


def _section(results: Results, study: str, dimensions: int, many: int, few: int) -> str:
    """What a study of a system of so many dimensions says, and of the target."""
    rows = error_rows(results.table(study, "resolution", TABLES["resolution"]))
    parts = [
        "Equal cells with moves from their centres, averaged over start points in a cell, or "
        "multilinear: shared among the cells around the end of a move. *Goals in the middle* are "
        "equal cells, averaged, but that each goal is in the middle of its cell. *Varying* cells "
        "begin so, and are halved where the tasks are likely to lead: those of a seed "
        "together, or each task on cells of its own. The error is the root mean "
        "square over hypotheses and tasks, with a 95 % interval over tasks; the order is the power "
        f"of the number of cells with which it falls, and {dimensions} times that in the width of "
        f"a cell of {dimensions} dimensions. What sampled paths err by is taken off.",
        _target(rows, many, few),
    ]
    for reference, title in PANELS.items():
        if not (rows["reference"] == reference).any():
            continue
        parts.append(f"Error {title}:\n\n{_table(rows[rows['reference'] == reference])}")
    return "\n\n".join(parts)


def _target(rows: pd.DataFrame, most: int, least: int) -> str:
    """Whether few varying cells do as well as many equal ones, a line a reference."""
    lines = []
    for reference, title in PANELS.items():
        some = rows[rows["reference"] == reference]
        equal = some[some["kind"].isin(["centre", "averaged"])]
        near = equal[(equal["count"] / most).between(0.9, 1.1)]
        for kind in ("varying", "of each task"):
            varying = some[(some["kind"] == kind) & (some["count"] <= least)]
            if not len(equal) or not len(varying):
                continue
            few = varying.loc[varying["error"].idxmin()]
            opening = f"- {title}: {few['count']:.0f} cells, {KINDS[kind]}, err by {_error(few)}, "
            if not len(near):
                lines.append(opening + _extrapolated(equal, most, few["error"]))
                continue
            many = near.loc[near["error"].idxmin()]
            of_kind = some[some["kind"] == kind]
            verdict = (
                "met"
                if few["error"] <= many["error"]
                else f"missed: {_enough(of_kind, many['error'])}"
            )
            lines.append(
                f"{opening}{many['count']:.0f} cells, {KINDS[many['kind']]}, by {_error(many)}; "
                f"the target, no larger an error, is {verdict}."
            )
    if any("missed" in line for line in lines):
        lines.append(
            "\nVarying cells begin as equal ones, so that their higher order gains little with few."
        )
    return "\n".join(lines)


def _enough(rows: pd.DataFrame, aim: float) -> str:
    """How many cells of a kind err by no more than some error, between the numbers tried."""
    able = rows[rows["error"] > 0].sort_values("error")
    if not len(able) or aim < able["error"].min():
        return "more are needed than were tried"
    count = np.exp(np.interp(np.log(aim), np.log(able["error"]), np.log(able["count"])))
    return f"about {count:.0f} are needed"


def _extrapolated(equal: pd.DataFrame, most: int, aim: float) -> str:
    """What so many equal cells would err by, where fewer were tried, if their order holds on."""
    last = equal[equal["count"] == equal["count"].max()]
    many = last.loc[last["error"].idxmin()]
    order = slope(equal[equal["kind"] == many["kind"]])
    told = (
        f"{many['count']:.0f} cells, {KINDS[many['kind']]}, by {_error(many)}. {most} of these "
        "were not tried"
    )
    if not np.isfinite(order):
        return f"{told}."
    error = many["error"] * (many["count"] / most) ** order
    verdict = "met" if aim <= error else "missed"
    return (
        f"{told}; if their error goes on to fall with the order {order:.2f}, they err by "
        f"{number(error)}, and the target, no larger an error, is {verdict}."
    )


def _table(rows: pd.DataFrame) -> str:
    """A line a kind, a column a number of cells that was asked for."""
    lines, levels = [], max(len(some) for _, some in rows.groupby("kind"))
    for kind, label in KINDS.items():
        some = rows[rows["kind"] == kind].sort_values("count")
        if not len(some):
            continue
        each = [f"{row['count']:.0f}: {_error(row)}" for _, row in some.iterrows()]
        order = slope(some)
        lines.append([label, *each, *[""] * (levels - len(each)), f"{order:.2f}"])
    return table(["cells", *[f"number {i + 1}" for i in range(levels)], "order"], lines, words=1)


def _error(row: pd.Series) -> str:
    """An error with its interval, and of how many tasks where some are not possible."""
    text = between(*(number(row[name]) for name in ("error", "low", "high")))
    lost = row["tasks"] - row["possible"]
    return f"{text}, {lost:.0f} of {row['tasks']:.0f} tasks not possible" if lost else text
