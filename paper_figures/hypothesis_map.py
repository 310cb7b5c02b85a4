"""The constraint hypotheses coloured by likelihood gain, the demonstrations drawn over them."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from paper_figures.style import COLUMN, RC, TRUTH, new_figure

TOP = 5


def draw(
    hypotheses: pd.DataFrame, paths: pd.DataFrame, dimensions: pd.DataFrame, title: str = ""
) -> Figure:
    """Draw one ranking.

    Args:
        hypotheses: one row a hypothesis: rank, gain [nat], feasible, and lower_<d>, upper_<d> of
            each dimension d; optionally `covered_by_truth`.
        paths: the demonstrations: demonstration, and a column for each dimension.
        dimensions: name, unit, lower, upper and periodic of each dimension of the state. The
            first two that hypotheses bound are drawn, or, where they bound one, that and another.
        title: above the axes.
    """
    free = [not np.isfinite(hypotheses[f"lower_{name}"]).any() for name in dimensions["name"]]
    order = np.argsort(free, kind="stable")[:2]
    x, y = (dimensions.iloc[place] for place in sorted(order))
    figure, axes = new_figure(COLUMN, 3.1)
    with plt.rc_context(RC):
        boxes = _rectangles(hypotheses, x, y)
        feasible = hypotheses["feasible"].to_numpy(dtype=bool)
        gain = hypotheses["gain"].to_numpy(dtype=float)
        finite = gain[feasible & np.isfinite(gain)]
        top = max(float(finite.max(initial=0.0)), 1e-3)
        cells = PatchCollection(
            [box for box, keep in zip(boxes, feasible, strict=True) if keep],
            cmap="YlGnBu",
            edgecolor="#b0b0b0",
            linewidth=0.3,
        )
        # Gains spread over decades: the square root keeps the small ones apart from none.
        cells.set_array(np.sqrt(np.minimum(gain[feasible], top)))
        cells.set_clim(0, np.sqrt(top))
        axes.add_collection(cells)
        axes.add_collection(
            PatchCollection(
                [box for box, keep in zip(boxes, feasible, strict=True) if not keep],
                facecolor="#f1f1f1",
                edgecolor="#b0b0b0",
                linewidth=0.3,
            )
        )
        _draw_paths(axes, paths, x, y)
        for row, box in zip(hypotheses.itertuples(), boxes, strict=True):
            if row.feasible and row.rank <= TOP and row.gain > 0:
                axes.add_patch(_outline(box, "black", 1.0))
                middle = (box.get_x() + box.get_width() / 2, box.get_y() + box.get_height() / 2)
                axes.text(
                    *middle,
                    f"{row.rank:g}",
                    ha="center",
                    va="center",
                    fontsize=7,
                    fontweight="bold",
                    bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8},
                    zorder=5,
                )
            if getattr(row, "covered_by_truth", False):
                axes.add_patch(_outline(box, TRUTH, 2.0))
        axes.set_xlim(x["lower"], x["upper"])
        axes.set_ylim(y["lower"], y["upper"])
        axes.set_xlabel(f"{x['name'].replace('_', ' ')} [{x['unit']}]")
        axes.set_ylabel(f"{y['name'].replace('_', ' ')} [{y['unit']}]")
        axes.set_title(title)
        bar = figure.colorbar(cells, ax=axes, shrink=0.85, pad=0.02)
        ticks = top * np.array([0, 1 / 16, 1 / 4, 9 / 16, 1])
        bar.set_ticks(np.sqrt(ticks).tolist(), labels=[f"{tick:.2g}" for tick in ticks])
        bar.set_label("likelihood gain $L_i$ [nat]")
        bar.outline.set_linewidth(0.5)
        _legend(figure, "covered_by_truth" in hypotheses)
    return figure


def _rectangles(hypotheses: pd.DataFrame, x: pd.Series, y: pd.Series) -> list[Rectangle]:
    """Each hypothesis in the plane of x and y; a free side spans the axis."""
    corners = [
        hypotheses[[f"{side}_{x['name']}", f"{side}_{y['name']}"]].to_numpy(dtype=float)
        for side in ("lower", "upper")
    ]
    lower, upper = (
        np.where(np.isfinite(corner), corner, [x[side], y[side]])
        for corner, side in zip(corners, ("lower", "upper"), strict=True)
    )
    return [Rectangle(tuple(a), *(b - a)) for a, b in zip(lower, upper, strict=True)]


def _outline(box: Rectangle, colour: str, width: float) -> Rectangle:
    """The border of a box."""
    return Rectangle(
        box.get_xy(),
        box.get_width(),
        box.get_height(),
        fill=False,
        edgecolor=colour,
        linewidth=width,
        zorder=4,
    )


def _draw_paths(axes: Axes, paths: pd.DataFrame, x: pd.Series, y: pd.Series) -> None:
    """Each path as a thin line, broken where a periodic dimension wraps; starts and ends marked."""
    for _, path in paths.groupby("demonstration", sort=True):
        points = path[[x["name"], y["name"]]].to_numpy(dtype=float).copy()
        for column, dimension in enumerate((x, y)):
            if dimension["periodic"]:
                period = dimension["upper"] - dimension["lower"]
                wrapped = dimension["lower"] + (points[:, column] - dimension["lower"]) % period
                points[:, column] = wrapped
                jump = np.abs(np.diff(wrapped)) > period / 2
                points = np.insert(points, np.flatnonzero(jump) + 1, np.nan, axis=0)
        axes.plot(*points.T, color="#444444", linewidth=0.5, alpha=0.6, zorder=3)
        axes.plot(*points[0], "o", color="#444444", markersize=2, zorder=3)
        axes.plot(*points[-1], "s", color="#444444", markersize=2.2, zorder=3)


def _legend(figure: Figure, with_truth: bool) -> None:
    """What the signs mean, below the axes."""
    entries: list[object] = [
        Line2D([], [], color="#444444", linewidth=0.7, label="demonstration"),
        Line2D([], [], color="#444444", marker="o", markersize=3, linestyle="", label="start"),
        Line2D([], [], color="#444444", marker="s", markersize=3, linestyle="", label="end"),
        Patch(facecolor="#f1f1f1", edgecolor="#b0b0b0", linewidth=0.5, label="violated"),
        Patch(facecolor="white", edgecolor="black", linewidth=1.0, label=f"top {TOP}, by rank"),
    ]
    if with_truth:
        entries.append(Patch(facecolor="white", edgecolor=TRUTH, linewidth=1.6, label="truth"))
    figure.legend(handles=entries, loc="outside lower center", ncols=3)
