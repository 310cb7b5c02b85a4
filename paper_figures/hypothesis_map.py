"""The hypotheses of one point coloured by likelihood gain, the demonstrations drawn over them."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from paper_figures.plane import Plane, numbered, outline
from paper_figures.rows import described, gain_in_words
from paper_figures.style import (
    COLUMN,
    EDGE,
    GAIN,
    PATH,
    RC,
    TRUTH,
    UNAVOIDABLE,
    VIOLATED,
    new_figure,
)

TABLES = {
    "example_ranking": ("truth", "cells", "actions", "dt", "hypothesis", "gain", "rank"),
    "example_paths": ("truth", "demonstration"),
    "example_dimensions": ("truth", "name", "unit", "lower", "upper", "periodic"),
}
EACH = "truth"
TOP = 5


def draw(
    example_ranking: pd.DataFrame, example_paths: pd.DataFrame, example_dimensions: pd.DataFrame
) -> Figure:
    """Draw one ranking.

    Args:
        example_ranking: one row a hypothesis: rank, gain [nat], missing where it is unavoidable,
            feasible, and lower_<d>, upper_<d> of each dimension d; optionally `covered_by_truth`,
            and what the point was.
        example_paths: the demonstrations: demonstration, and a column for each dimension.
        example_dimensions: name, unit, lower, upper and periodic of each dimension of the state.
            The first two that hypotheses bound are drawn, or, where they bound one, that and
            another.
    """
    hypotheses, plane = example_ranking, Plane.of(example_ranking, example_dimensions)
    figure, axes = new_figure(COLUMN, 3.1)
    with plt.rc_context(RC):
        feasible = hypotheses["feasible"].to_numpy(dtype=bool)
        gain = hypotheses["gain"].to_numpy(dtype=float)
        finite = gain[feasible & np.isfinite(gain)]
        top = max(float(finite.max(initial=0.0)), 1e-3)
        # Gains spread over decades: the square root keeps the small ones apart from none.
        root = np.sqrt(np.minimum(gain[feasible], top))
        cells = plane.cells(axes, hypotheses[feasible], array=root, cmap=GAIN)
        cells.set_clim(0, np.sqrt(top))
        plane.cells(axes, hypotheses[~feasible], facecolor=VIOLATED)
        unavoidable = np.isnan(gain)
        if unavoidable.any():
            plane.cells(axes, hypotheses[unavoidable], facecolor=UNAVOIDABLE)
        _draw_paths(axes, example_paths, plane)
        for row, box in zip(hypotheses.itertuples(), plane.rectangles(hypotheses), strict=True):
            if row.feasible and row.rank <= TOP and row.gain > 0:
                numbered(axes, box, row.rank)
            if getattr(row, "covered_by_truth", False):
                axes.add_patch(outline(box, TRUTH, 2.0))
        plane.dress(axes)
        if "truth" in hypotheses:
            axes.set_title(described(hypotheses, r"$\Delta t$"))
        bar = figure.colorbar(cells, ax=axes, shrink=0.85, pad=0.02)
        ticks = top * np.array([0, 1 / 16, 1 / 4, 9 / 16, 1])
        bar.set_ticks(np.sqrt(ticks).tolist(), labels=[f"{tick:.2g}" for tick in ticks])
        bar.set_label("likelihood gain $L_i$, square-root scale [nat]")
        bar.outline.set_linewidth(0.5)
        _legend(figure, "covered_by_truth" in hypotheses, bool(unavoidable.any()))
    return figure


def facts(
    example_ranking: pd.DataFrame, example_paths: pd.DataFrame, example_dimensions: pd.DataFrame
) -> str:
    """What the caption says."""
    best = example_ranking.sort_values("rank", kind="stable")
    ruled_out = int(np.sum(~best["feasible"].astype(bool)))
    lines = [
        "Hypotheses ranked by the likelihood gain of forbidding them.",
        f"Point {best['point'].iloc[0]}: {described(best)}.",
        f"Demonstrations: {example_paths['demonstration'].nunique()}.",
        f"Hypotheses: {len(best)}, of which some demonstration violates {ruled_out}.",
        *(
            f"Rank {row.rank:g}: hypothesis {row.hypothesis}, {gain_in_words(row.gain)}, "
            f"posterior {row.posterior:.3g}{', inside the truth' * bool(row.covered_by_truth)}."
            for row in best.head(TOP).itertuples()
        ),
        "Uncertainty: none is drawn; this is one ranking of one set of demonstrations.",
    ]
    return "\n".join(lines)


def _draw_paths(axes: Axes, paths: pd.DataFrame, plane: Plane) -> None:
    """Each path as a thin line, broken where a periodic dimension wraps; starts and ends marked."""
    for _, path in paths.groupby("demonstration", sort=True):
        points = plane.line(path)
        axes.plot(*points.T, color=PATH, linewidth=0.5, alpha=0.6, zorder=3)
        axes.plot(*points[0], "o", color=PATH, markersize=2, zorder=3)
        axes.plot(*points[-1], "s", color=PATH, markersize=2.2, zorder=3)


def _legend(figure: Figure, with_truth: bool, with_unavoidable: bool) -> None:
    """What the signs mean, below the axes."""
    entries: list[object] = [
        Line2D([], [], color=PATH, linewidth=0.7, label="demonstration"),
        Line2D([], [], color=PATH, marker="o", markersize=3, linestyle="", label="start"),
        Line2D([], [], color=PATH, marker="s", markersize=3, linestyle="", label="end"),
        Patch(facecolor=VIOLATED, edgecolor=EDGE, linewidth=0.5, label="violated"),
        Patch(facecolor="white", edgecolor="black", linewidth=1.0, label=f"top {TOP}, by rank"),
    ]
    if with_unavoidable:
        entries.append(Patch(facecolor=UNAVOIDABLE, label="unavoidable"))
    if with_truth:
        entries.append(Patch(facecolor="white", edgecolor=TRUTH, linewidth=1.6, label="truth"))
    figure.legend(handles=entries, loc="outside lower center", ncols=3)
