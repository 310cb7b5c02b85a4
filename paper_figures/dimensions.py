"""Time and memory of a task without a grid, from 2 to 12 dimensions, beside those of cells."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from paper_figures.style import GUIDE, OTHER_COLOURS, OTHER_MARKS, PAGE, RC, new_figure

TABLES = {
    "dimensions": (
        *("factor", "value", "dimensions", "samples", "steps", "modes"),
        *("search_s", "draw_s", "task_s", "peak_mb", "cpu", "python", "numpy", "commit", "date"),
    )
}
CELLS = 10  # of a grid, along each dimension
_BYTES = 8  # of one number a cell; a model has many
_TIMES = {"task_s": "whole task", "search_s": "search for modes", "draw_s": "4000 paths"}


def slopes(dimensions: pd.DataFrame) -> pd.DataFrame:
    """The power of each size with which time grows, a row a factor.

    Returns:
        `factor`; `least` and `most`, its values; the slopes `search`, `draw` and `task` of log time
        against log size by least squares, and `last`, of drawing between the two largest.
    """
    rows = []
    for factor, some in dimensions.groupby("factor", sort=False):
        some = some.sort_values("value")
        x, logs = np.log(some["value"]), np.log(some[list(_TIMES)])
        row = {"factor": factor, "least": some["value"].min(), "most": some["value"].max()}
        row |= {name.removesuffix("_s"): np.polyfit(x, logs[name], 1)[0] for name in _TIMES}
        last = np.diff(logs["draw_s"].iloc[-2:]) / np.diff(x.iloc[-2:])
        rows.append({**row, "last": float(last[0])})
    return pd.DataFrame(rows)


def draw(dimensions: pd.DataFrame) -> Figure:
    """Draw time and memory against dimensions, and drawing against all that makes it longer."""
    figure, (left, middle, right) = new_figure(PAGE, 3.2, ncols=3)
    rows = dimensions[dimensions["factor"] == "dimensions"].sort_values("value")
    with plt.rc_context(RC):
        for number, (column, label) in enumerate(_TIMES.items()):
            look = {"color": OTHER_COLOURS[number], "marker": OTHER_MARKS[number]}
            left.plot(rows["value"], rows[column], label=label, **look)
        cubic = rows["task_s"].iloc[-1] * (rows["value"] / rows["value"].iloc[-1]) ** 3
        left.plot(rows["value"], cubic, color=GUIDE, linestyle=":", linewidth=0.8, label="slope 3")
        left.set_ylabel("processor time [s]")
        middle.plot(rows["value"], rows["peak_mb"], "k^-", label="sampled paths")
        middle.plot(
            rows["value"],
            grid_megabytes(rows["value"]),
            color=OTHER_COLOURS[1],
            linestyle="--",
            marker="s",
            label=f"{CELLS}$^n$ cells, one number each",
        )
        middle.set_ylabel("memory [MB]")
        for axes in (left, middle):
            _on_logarithms(axes)
            axes.set_xticks(rows["value"], labels=list(map(str, rows["value"])))
            axes.set_xlabel("dimensions n [1]")
        _draw_growth(right, dimensions)
        for axes in (left, middle, right):
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22))
    return figure


def grid_megabytes(dimensions: pd.Series) -> pd.Series:
    """Memory [MB] of one number for each cell of a grid."""
    return float(CELLS) ** dimensions * _BYTES / 1e6


def _draw_growth(axes: Axes, table: pd.DataFrame) -> None:
    """Drawing and weighing paths, as multiples of the time at the smallest size."""
    for number, (factor, some) in enumerate(table.groupby("factor", sort=False)):
        rows = some.sort_values("value")
        axes.plot(
            rows["value"] / rows["value"].iloc[0],
            rows["draw_s"] / rows["draw_s"].iloc[0],
            color=OTHER_COLOURS[number],
            marker=OTHER_MARKS[number],
            label=factor,
        )
    axes.plot([1, 16], [1, 16], color=GUIDE, linestyle=":", linewidth=0.8, label="slope 1")
    _on_logarithms(axes)
    axes.set_xlabel("size [multiple]")
    axes.set_ylabel("time to draw [multiple]")


def _on_logarithms(axes: Axes) -> None:
    """Logarithmic axes, with numbers at the powers of ten alone."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(NullFormatter())


def facts(dimensions: pd.DataFrame) -> str:
    """What the caption says."""
    first, rows = dimensions.iloc[0], dimensions[dimensions["factor"] == "dimensions"]
    lines = [
        "One task of chains of one to six links, of which each has two dimensions, without a grid:",
        "processor time of one thread (left), peak memory of the process beside that of a grid",
        f"with one number a cell, {CELLS} cells a dimension (middle), and the time to draw and",
        "weigh paths against what makes it longer (right). Each time is the quickest of three, so",
        "that there are no intervals.",
    ]
    for row in rows.sort_values("value").itertuples():
        lines.append(
            f"  {row.value} dimensions: {row.task_s:.3g} s and {row.peak_mb:.0f} MB; a grid "
            f"{float(CELLS) ** row.value:.0e} cells"
        )
    for row in slopes(dimensions).itertuples():
        lines.append(
            f"  {row.factor} from {row.least} to {row.most}: drawing grows with the power "
            f"{row.draw:.2f} ({row.last:.2f} at the end), the search with {row.search:.2f}, the "
            f"whole task with {row.task:.2f}"
        )
    lines.append(
        f"Measured on {first['cpu']}, Python {first['python']}, numpy {first['numpy']}, commit "
        f"{first['commit']}, {first['date']}."
    )
    return "\n".join(lines)
