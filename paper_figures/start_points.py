"""What several start points in a cell buy: coarse cells with them, and beside finer cells."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from paper_figures.rows import PAPER, Unsuited
from paper_figures.style import CELL_COLOURS, GUIDE, PAGE, RC, new_figure

_KEYS = ("truth", "cells", "samples", "dt")
TABLES = {
    "measures": (*_KEYS, "measure", "mean", "low", "high"),
    "rank_curve": (*_KEYS, "demonstrations", "median", "median_low", "median_high", "share_top_5"),
}

_MEASURES = {
    "reachable": ("reachable goals [%]", 100),
    "final_state_error": ("final-state error", 1),
    "violation_distance": ("violation distance", 1),
}
_MARKS = {1: "o", 2: "v", 3: "D"}  # by samples
_SHIFT = 0.02  # of a time step, between the marks of different settings


def draw(measures: pd.DataFrame, rank_curve: pd.DataFrame) -> Figure:
    """Draw a row of panels a truth, against the time step; a curve a setting of the cells."""
    table = _joined(measures, rank_curve)
    truths, settings = sorted(table["truth"].unique()), _settings(table)
    ticks = _apart(sorted(table["dt"].unique()))
    panels = {**_MEASURES, "median": ("rank of truth", 1), "top": ("in top 5 [%]", 100)}
    figure, grid = new_figure(
        PAGE,
        0.6 + 1.5 * len(truths),
        nrows=len(truths),
        ncols=len(panels),
        sharex=True,
        sharey="col",
        squeeze=False,
    )
    with plt.rc_context(RC):
        for row, truth in zip(grid, truths, strict=True):
            for axes, (name, (title, factor)) in zip(row, panels.items(), strict=True):
                for number, (cells, samples) in enumerate(settings):
                    of_setting = (table["cells"] == cells) & (table["samples"] == samples)
                    curve = table[of_setting & (table["truth"] == truth)]
                    middle, low, high = (
                        factor * curve[name + end] for end in ("", "_low", "_high")
                    )
                    axes.errorbar(
                        curve["dt"] * (1 + _SHIFT * (number - 1)),
                        middle,
                        yerr=[(middle - low).clip(lower=0), (high - middle).clip(lower=0)],
                        color=_colour(cells, samples),
                        marker=_MARKS.get(samples, "P"),
                        markerfacecolor="white" if samples > 1 else None,
                        linestyle="-" if samples > 1 else "--" if cells > settings[0][0] else ":",
                        elinewidth=0.8,
                        label=_label(cells, samples),
                    )
                axes.set_xscale("log")
                axes.set_xticks(ticks, labels=[f"{tick:g}" for tick in ticks])
                axes.xaxis.set_minor_locator(NullLocator())
                if name == "median":
                    axes.set_yscale("log")
                    axes.set_yticks((1, 2, 5, 10, 20, 50), labels=["1", "2", "5", "10", "20", "50"])
                    axes.yaxis.set_minor_locator(NullLocator())
                axes.set_title(f"{truth.upper()}: {title}", fontsize=7)
        for axes in grid[-1]:
            axes.set_xlabel("$\\Delta t$ [s]")
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(settings))
    return figure


def facts(measures: pd.DataFrame, rank_curve: pd.DataFrame) -> str:
    """What the caption says."""
    table = _joined(measures, rank_curve)
    after = min(PAPER, rank_curve["demonstrations"].max())
    lines = [
        "Start points of a cell's moves along each dimension: 1 is the paper's, the centre.",
        f"Rank and share in the top 5: after {after} demonstrations, over random subsets of them.",
        "Bars: 95 % bootstrap intervals (of rank and share over subsets, of the others over",
        "demonstrations). Marks of one time step stand side by side.",
    ]
    for row in table.itertuples():
        lines.append(
            f"  {row.truth.upper()}, {_label(row.cells, row.samples)}, dt {row.dt:g} s: "
            f"{100 * row.reachable:.0f} % of the goals reachable, final-state error "
            f"{row.final_state_error:.3g}, violation distance {row.violation_distance:.3g}, median "
            f"rank {row.median:.3g} ({row.median_low:.3g} to {row.median_high:.3g}), in the top 5 "
            f"{100 * row.top:.0f} % ({100 * row.top_low:.0f} to {100 * row.top_high:.0f})"
        )
    return "\n".join(lines)


def _joined(measures: pd.DataFrame, rank_curve: pd.DataFrame) -> pd.DataFrame:
    """A row a truth, setting and time step, with each number and the ends of its interval."""
    if measures["samples"].nunique() < 2:
        raise Unsuited("all points have the same number of start points in a cell")
    at = rank_curve[rank_curve["demonstrations"] == min(PAPER, rank_curve["demonstrations"].max())]
    table = at.rename(columns=lambda name: name.replace("share_top_5", "top"))
    for name in _MEASURES:
        part = measures[measures["measure"] == name][[*_KEYS, "mean", "low", "high"]]
        part = part.set_axis([*_KEYS, name, f"{name}_low", f"{name}_high"], axis=1)
        table = table.merge(part, how="left", on=list(_KEYS))
    if table.duplicated(list(_KEYS)).any():
        raise Unsuited(f"rows differ in more than {', '.join(_KEYS)}")
    return table.sort_values(list(_KEYS), kind="stable")


def _settings(table: pd.DataFrame) -> list[tuple[int, int]]:
    """Cells and samples of each curve."""
    pairs = table[["cells", "samples"]].drop_duplicates().sort_values(["cells", "samples"])
    return [(int(cells), int(samples)) for cells, samples in pairs.to_numpy()]


def _apart(values: list[float]) -> list[float]:
    """Those of ascending values that are far enough apart for labels on a logarithmic axis."""
    ticks = values[:1]
    for value in values:
        if value > 1.5 * ticks[-1]:
            ticks.append(value)
    return ticks


def _label(cells: int, samples: int) -> str:
    """A setting in words."""
    return f"{cells} cells, {samples} start point{'s' if samples > 1 else ''} a dimension"


def _colour(cells: int, samples: int) -> str:
    """The colour of the cells; black with more samples."""
    return "black" if samples > 1 else CELL_COLOURS.get(cells, GUIDE)
