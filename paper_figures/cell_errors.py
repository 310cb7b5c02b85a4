"""How the error of Phi falls with the number of cells, for equal cells and for others."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from paper_figures.rows import Unsuited
from paper_figures.style import GUIDE, PAGE, RC, SIX_COLOURS, SIX_MARKS, new_figure, whiskers

TABLES = {
    "resolution": (
        *("seed", "kind", "count", "task", "possible"),
        *("error", "noise", "trusted", "error_of_cells"),
    ),
}

# What each kind of cells is called, in order of the legend.
KINDS = {
    "centre": "equal, from centres",
    "averaged": "equal, averaged",
    "multilinear": "equal, multilinear",
    "round goals": "equal, goals in the middle",
    "varying": "varying",
    "of each task": "varying, for each task alone",
}
PANELS = {"error": "against sampled paths", "error_of_cells": "against very many equal cells"}
_REPLICATES = 1000  # of tasks, for intervals


def error_rows(resolution: pd.DataFrame) -> pd.DataFrame:
    """A row a reference, kind of cells and number of them that was asked for.

    Numbers that are asked for lead to slightly different ones where cells are split round goals;
    they are taken together by their order within a kind, seed and task.

    Returns:
        `reference`, a column of PANELS; `kind`; mean `count`; `tasks`, and how many of them the
        cells can do (`possible`); root mean square `error`, with a 95 % interval, `low` to `high`,
        from tasks that are drawn again. What sampled paths err by is taken off its square.
    """
    table = resolution.copy()
    table["level"] = table.groupby(["kind", "seed", "task"])["count"].rank(method="dense")
    rows = []
    for reference in PANELS:
        sampled = reference == "error"
        known = table[table["trusted"]] if sampled else table[table[reference].notna()]
        for (kind, _), group in known.groupby(["kind", "level"]):
            squares = np.square(group[reference].to_numpy())
            if sampled:
                squares = squares - np.square(group["noise"].to_numpy())
            rng = np.random.default_rng(0)
            again = rng.choice(squares, (_REPLICATES, len(squares))).mean(axis=1)
            low, high = np.sqrt(np.maximum(np.quantile(again, [0.025, 0.975]), 0.0))
            rows.append(
                {
                    "reference": reference,
                    "kind": kind,
                    "count": group["count"].mean(),
                    "tasks": len(group),
                    "possible": int(group["possible"].sum()),
                    "error": float(np.sqrt(max(squares.mean(), 0.0))),
                    "low": low,
                    "high": high,
                }
            )
    return pd.DataFrame(rows)


def slope(rows: pd.DataFrame) -> float:
    """The order of convergence in the number of cells, where the cells can do every task.

    The least squares fit of log error to log number; NaN of fewer than two that are above 0, as
    none is whose paths err by more.
    """
    able = rows[(rows["possible"] == rows["tasks"]) & (rows["error"] > 0)]
    if len(able) < 2:
        return np.nan
    return float(-np.polyfit(np.log(able["count"]), np.log(able["error"]), 1)[0])


def draw(resolution: pd.DataFrame) -> Figure:
    """Draw a panel a reference, with a line a kind of cells."""
    if resolution["count"].nunique() < 2:
        raise Unsuited("one number of cells makes no line")
    rows = error_rows(resolution)
    shown = {key: title for key, title in PANELS.items() if (rows["reference"] == key).any()}
    figure, panels = new_figure(PAGE, 3.0, ncols=len(shown), sharey=True)
    panels = np.atleast_1d(panels)
    with plt.rc_context(RC):
        for axes, (reference, title) in zip(panels, shown.items(), strict=True):
            looks = zip(KINDS.items(), SIX_COLOURS, SIX_MARKS, strict=True)
            for (kind, label), colour, mark in looks:
                some = rows[(rows["reference"] == reference) & (rows["kind"] == kind)]
                some = some[some["possible"] == some["tasks"]]
                if not len(some):
                    continue
                axes.errorbar(
                    some["count"],
                    some["error"],
                    whiskers(some["error"], some["low"], some["high"]),
                    color=colour,
                    marker=mark,
                    linewidth=1.0,
                    elinewidth=0.5,
                    label=label,
                )
            axes.set_title(title)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlabel("cells")
        noise = float(np.sqrt(np.nanmean(np.square(resolution["noise"]))))
        panels[0].axhline(noise, color=GUIDE, linewidth=0.6, linestyle=":", zorder=0)
        panels[0].set_ylabel("error of $\\Phi$, root mean square [probability]")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def facts(resolution: pd.DataFrame) -> str:
    """What the caption says."""
    rows = error_rows(resolution)
    lines = [
        "Root mean square error of Phi over hypotheses and tasks against the number of cells, with",
        "95 % intervals from tasks that are drawn again. Against paths sampled without cells, of",
        "which the standard errors (dotted) are taken off, and, where that was asked for, against",
        "very many equal cells with the same actions. Only numbers of cells that can do every task",
        "are drawn.",
    ]
    for (reference, kind), some in rows.groupby(["reference", "kind"], sort=False):
        order = slope(some)
        errors = ", ".join(
            f"{row.error:.3f} [{row.low:.3f}, {row.high:.3f}] of {row.count:.0f}"
            for row in some.rename(columns={"count": "cells"})
            .assign(count=some["count"])
            .itertuples(index=False)
        )
        lines.append(
            f"  {PANELS[reference]}, {KINDS[kind]}: {errors} cells; error falls with number to "
            f"the power of {order:.2f}"
        )
    return "\n".join(lines)
