"""A demonstration beside trajectories sampled from several grids (the paper's Fig. 6)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from paper_figures.plane import Plane, outline
from paper_figures.rows import Unsuited
from paper_figures.style import (
    DEMONSTRATION,
    EDGE,
    GOAL,
    PAGE,
    RC,
    SAMPLED,
    START,
    TRUTH,
    new_figure,
)

TABLES = {
    "compared_cells": ("point", "truth", "cells", "actions", "dt", "trial", "step", "cell"),
    "compared_violations": ("truth", "cells", "source", "hypothesis"),
    "compared_paths": ("truth", "demonstration", "time"),
    "example_ranking": ("truth", "hypothesis"),
    "example_regions": ("truth", "region"),
    "example_dimensions": ("truth", "name", "unit", "lower", "upper", "periodic"),
}
# Whose hatching leans which way, and in which colour.
_HATCHES = {"demonstration": ("\\\\\\\\\\", DEMONSTRATION), "sampled": ("/////", SAMPLED)}


def draw(
    compared_cells: pd.DataFrame,
    compared_violations: pd.DataFrame,
    compared_paths: pd.DataFrame,
    example_ranking: pd.DataFrame,
    example_regions: pd.DataFrame,
    example_dimensions: pd.DataFrame,
) -> Figure:
    """Draw a row of panels a truth, coarse to fine.

    Args:
        compared_cells: cells that the sampled trajectory visits, in each grid, with corners.
        compared_violations: hypotheses that it and the demonstration violate, with corners.
        compared_paths: the demonstration.
        example_ranking: all hypotheses, for their edges.
        example_regions: the boxes of each truth.
        example_dimensions: a row a dimension of the state.
    """
    if not len(compared_cells):
        raise Unsuited("no demonstration is feasible in all grids")
    truths = sorted(compared_cells["truth"].unique())
    across = max(part["cells"].nunique() for _, part in compared_cells.groupby("truth"))
    figure, grid = new_figure(
        PAGE * max(2, across) / 3,
        0.6 + 1.75 * len(truths),
        nrows=len(truths),
        ncols=across,
        sharex=True,
        sharey=True,
        squeeze=False,
    )
    with plt.rc_context(RC):
        for truth, panels in zip(truths, grid, strict=True):
            visits, violations, path, hypotheses, truth_boxes, state = (
                table[table["truth"] == truth]
                for table in (
                    *(compared_cells, compared_violations, compared_paths),
                    *(example_ranking, example_regions, example_dimensions),
                )
            )
            plane = Plane.of(hypotheses, state)
            for axes, (cells, visited) in zip(panels, visits.groupby("cells"), strict=False):
                plane.cells(axes, hypotheses, facecolor="none", zorder=1)
                _draw_visits(axes, visited, plane)
                _draw_violations(axes, violations[violations["cells"] == cells], plane)
                axes.plot(*plane.line(path).T, color=DEMONSTRATION, linewidth=1.3, zorder=6)
                for box in plane.regions(truth_boxes):
                    axes.add_patch(outline(box, TRUTH, 1.8, zorder=5))
                plane.dress(axes)
                axes.label_outer()
                step = f"$\\Delta t$ = {visited['dt'].iloc[0]:g} s"
                axes.set_title(f"{truth.upper()}, {cells} cells, {step}", loc="left")
        figure.legend(handles=_entries(), loc="outside lower center", ncols=4)
    return figure


def facts(
    compared_cells: pd.DataFrame,
    compared_violations: pd.DataFrame,
    compared_paths: pd.DataFrame,
    example_ranking: pd.DataFrame,
    example_regions: pd.DataFrame,
    example_dimensions: pd.DataFrame,
) -> str:
    """What the caption says."""
    lines = [
        "A demonstration, and beside it one trajectory sampled from the tabular MDP of each grid "
        "when the true constraint is known.",
        "dt is the one nearest to 0.25 s at which nine in ten demonstrations can be followed in "
        "all of these grids, or else the most; of those, the one is shown that passes nearest to "
        "the true constraint.",
        "Violated hypotheses are hatched: by the demonstration falling, by the trajectory rising.",
        "Uncertainty: none is drawn; the trajectory is one random sample.",
    ]
    for (truth, cells), visits in compared_cells.groupby(["truth", "cells"]):
        first = visits.iloc[0]
        of_panel = (compared_violations["truth"] == truth) & (compared_violations["cells"] == cells)
        by_source = compared_violations[of_panel].groupby("source")["hypothesis"]
        sets = {source: set(hypotheses) for source, hypotheses in by_source}
        observed, sampled = (sets.get(source, set()) for source in _HATCHES)
        lines.append(
            f"{truth.upper()}, {cells} cells, {first['actions']} actions, dt {first['dt']:g} s, "
            f"trial {first['trial']}: {visits['cell'].nunique()} cells visited; hypotheses "
            f"violated by the demonstration {len(observed)}, by the trajectory {len(sampled)}, by "
            f"both {len(observed & sampled)} (point {first['point']})."
        )
    return "\n".join(lines)


def _draw_visits(axes: Axes, visited: pd.DataFrame, plane: Plane) -> None:
    """Visited cells shaded, each once; the first and the last outlined."""
    once = plane.shadows(visited)
    plane.cells(axes, once, facecolor=SAMPLED, edgecolor=SAMPLED, alpha=0.45, zorder=2)
    ends = plane.rectangles(visited.sort_values("step").iloc[[0, -1]])
    for box, colour in zip(ends, (START, GOAL), strict=True):
        axes.add_patch(outline(box, colour, 1.6, zorder=7))


def _draw_violations(axes: Axes, violations: pd.DataFrame, plane: Plane) -> None:
    """Violated hypotheses hatched, by whom they are."""
    for source, (hatch, colour) in _HATCHES.items():
        boxes = violations[violations["source"] == source]
        style = {"facecolor": "none", "edgecolor": colour, "linewidth": 0}
        plane.cells(axes, boxes, hatch=hatch, zorder=3, **style)


def _entries() -> list[object]:
    """What the signs mean."""
    (falling, blue), (rising, pink) = _HATCHES.values()
    plain = {"facecolor": "white", "linewidth": 0.3}
    return [
        Line2D([], [], color=blue, linewidth=1.3, label="demonstration"),
        Patch(hatch=falling, **(plain | {"edgecolor": blue}), label="it violates"),
        Patch(facecolor=pink, alpha=0.45, label="cells of a sampled trajectory"),
        Patch(hatch=rising, **(plain | {"edgecolor": pink}), label="it violates"),
        Patch(facecolor="white", edgecolor=START, linewidth=1.6, label="start cell"),
        Patch(facecolor="white", edgecolor=GOAL, linewidth=1.6, label="goal cell"),
        Patch(facecolor="white", edgecolor=TRUTH, linewidth=1.8, label="true constraint"),
        Patch(facecolor="white", edgecolor=EDGE, linewidth=0.5, label="hypothesis"),
    ]
