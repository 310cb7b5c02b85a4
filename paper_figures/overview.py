"""The method at a glance, from one run (in the place of the paper's Fig. 1)."""

from __future__ import annotations

import itertools

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from paper_figures.plane import Plane, axis_label, centre, numbered, outline
from paper_figures.rows import Unsuited, described, gain_in_words
from paper_figures.style import (
    CHANCE,
    DEMONSTRATION,
    EDGE,
    GAIN,
    GUIDE,
    PAGE,
    PATH,
    RC,
    SAMPLED,
    TRUTH,
    UNAVOIDABLE,
    VIOLATED,
    new_figure,
)

TABLES = {
    "example_ranking": (
        *("point", "truth", "cells", "actions", "dt", "hypothesis", "feasible", "gain", "rank"),
        *("trial", "unconstrained"),
    ),
    "example_paths": ("truth", "demonstration"),
    "example_cells": ("truth", "trial", "step", "cell"),
    "example_moves": ("truth", "cell", "successor"),
    "example_regions": ("truth", "region"),
    "example_dimensions": ("truth", "name", "unit", "lower", "upper", "periodic"),
}
_PATHS = 15  # demonstrations, so that each can be seen
_STEPS = 5  # moves of the sampled trajectory that are shown
_NUMBERED = 5  # hypotheses whose rank is written


def draw(
    example_ranking: pd.DataFrame,
    example_paths: pd.DataFrame,
    example_cells: pd.DataFrame,
    example_moves: pd.DataFrame,
    example_regions: pd.DataFrame,
    example_dimensions: pd.DataFrame,
) -> Figure:
    """Draw demonstrations, moves of the tabular MDP, Phi of one trial, and the ranking.

    Args:
        example_ranking: the hypotheses of the example of each truth; the first truth is shown.
        example_paths: its demonstrations.
        example_cells: the cells of one trial's sampled trajectory, with corners.
        example_moves: the moves from these cells, with both cells' corners.
        example_regions: the boxes of the truth.
        example_dimensions: a row a dimension of the state.
    """
    if not len(example_regions):
        raise Unsuited("nothing is forbidden")
    ranking, paths, visits, moves, boxes, state = (
        _of_first(table, example_regions)
        for table in (
            *(example_ranking, example_paths, example_cells),
            *(example_moves, example_regions, example_dimensions),
        )
    )
    if not len(visits):
        raise Unsuited("no demonstration of the example is feasible")
    plane = Plane.of(ranking, state)
    figure, panels = new_figure(PAGE, 2.55, ncols=4)
    with plt.rc_context(RC):
        of_trial = paths[paths["demonstration"] == visits["trial"].iloc[0]]
        _draw_demonstrations(panels[0], paths, boxes, plane)
        panels[0].plot(*plane.line(of_trial).T, color=DEMONSTRATION, linewidth=1.2)
        _draw_moves(panels[1], visits, moves, plane)
        chances = _draw_chances(panels[2], ranking, of_trial, plane)
        gains = _draw_ranking(panels[3], ranking, boxes, plane)
        titles = ("1  demonstrate", "2  discretise", "3  expect", "4  rank")
        for axes, title in zip(panels, titles, strict=True):
            axes.set_title(title, loc="left", fontweight="bold")
        for axes in panels[2:]:
            axes.set_ylabel("")
            axes.set_yticklabels([])
        _bar(figure, panels[2], chances, r"$\Phi_i$ of one trial", power=1)
        _bar(figure, panels[3], gains, "gain $L_i$,\nsquare-root scale [nat]", power=2)
        figure.legend(handles=_legend(), loc="outside lower center", ncols=4)
    return figure


def facts(
    example_ranking: pd.DataFrame,
    example_paths: pd.DataFrame,
    example_cells: pd.DataFrame,
    example_moves: pd.DataFrame,
    example_regions: pd.DataFrame,
    example_dimensions: pd.DataFrame,
) -> str:
    """What the caption says."""
    ranking, paths, visits = (
        _of_first(table, example_regions)
        for table in (example_ranking, example_paths, example_cells)
    )
    inside = ranking[ranking["covered_by_truth"].astype(bool)]
    count = paths["demonstration"].nunique()
    trial = int(visits["trial"].iloc[0])
    lines = [
        f"Point {ranking['point'].iloc[0]}: {described(ranking)}.",
        f"1: the demonstration of trial {trial} (thick) and the first {min(_PATHS, count)} of "
        f"{count}; they avoid a region that the observer does not know (dashed).",
        f"2: cells of the tabular MDP that a trajectory sampled for trial {trial} visits in its "
        f"first {_STEPS} steps, the moves from them (thin) and those it takes (thick).",
        f"3: the probability Phi that an agent without constraint, with the start (dot) and goal "
        f"(square) of trial {trial}, violates each hypothesis; largest "
        f"{ranking['unconstrained'].max():.3g}.",
        f"4: hypotheses that no demonstration violates, {int(ranking['feasible'].sum())} of "
        f"{len(ranking)}, ranked by likelihood gain; true constraint outlined.",
        *(
            f"Rank of hypothesis {row.hypothesis}, inside the truth: {row.rank:g}, "
            f"{gain_in_words(row.gain)}, Phi in panel 3 {row.unconstrained:.3g}."
            for row in inside.itertuples()
        ),
        f"Trial {trial} is the one that would most likely violate the truth if it were allowed.",
        "Uncertainty: none is drawn; this is one run.",
    ]
    return "\n".join(lines)


def _legend() -> list[object]:
    """What the lines and signs mean."""
    sign = {"color": "black", "linestyle": "", "markersize": 3.5}
    return [
        Line2D([], [], color=DEMONSTRATION, linewidth=1.2, label="demonstration of the trial"),
        Line2D([], [], color=PATH, linewidth=0.6, label="other demonstrations"),
        Line2D([], [], color=TRUTH, linewidth=1.4, linestyle="--", label="true constraint"),
        Patch(facecolor=VIOLATED, edgecolor=EDGE, linewidth=0.5, label="violated hypothesis"),
        Line2D([], [], marker="o", label="start", **sign),
        Line2D([], [], marker="s", label="goal", **sign),
        Line2D([], [], color="black", linewidth=1.3, label="sampled moves"),
        Line2D([], [], color=GUIDE, linewidth=0.5, label="possible moves"),
    ]


def _of_first(table: pd.DataFrame, example_regions: pd.DataFrame) -> pd.DataFrame:
    """The rows of the first truth that forbids anything."""
    return table[table["truth"] == example_regions["truth"].min()]


def _draw_demonstrations(
    axes: Axes, paths: pd.DataFrame, boxes: pd.DataFrame, plane: Plane
) -> None:
    """Some paths, and the region that they avoid."""
    for _, path in list(paths.groupby("demonstration", sort=True))[:_PATHS]:
        axes.plot(*plane.line(path).T, color=PATH, linewidth=0.6)
    for box in plane.regions(boxes):
        box.set(facecolor="white", edgecolor=TRUTH, linewidth=1.4, linestyle="--", zorder=3)
        axes.add_patch(box)
        axes.text(*centre(box), "?", ha="center", va="center", color=TRUTH, fontweight="bold")
    plane.dress(axes)


def _draw_moves(axes: Axes, visits: pd.DataFrame, moves: pd.DataFrame, plane: Plane) -> None:
    """The first cells of a trajectory, the moves from them and those that it takes."""
    first = visits.sort_values("step").head(_STEPS + 1)
    arrows = moves[moves["cell"].isin(first["cell"])].drop_duplicates(["cell", "successor"])
    after = arrows[[name for name in arrows if name.startswith("successor_")]]
    after = after.rename(columns=lambda name: name.removeprefix("successor_"))
    visited: list[Rectangle] = []
    for box in plane.rectangles(first):
        visited.append(plane.beside(box, visited[-1]) if visited else box)
    place = dict(zip(first["cell"], visited, strict=True))
    begins = [place[cell] for cell in arrows["cell"]]
    ends = [plane.beside(*pair) for pair in zip(plane.rectangles(after), begins, strict=True)]
    for box in {box.get_xy(): box for box in visited}.values():
        box.set(facecolor=SAMPLED, alpha=0.45, linewidth=0)
        axes.add_patch(box)
    arrow = {"arrowstyle": "->", "shrinkA": 0, "shrinkB": 0, "mutation_scale": 5}
    steps = [
        *((GUIDE, 0.5, pair) for pair in zip(begins, ends, strict=True)),
        *(("black", 1.3, pair) for pair in itertools.pairwise(visited)),
    ]
    for colour, width, (begin, end) in steps:
        if centre(begin) != centre(end):
            style = {**arrow, "color": colour, "linewidth": width}
            axes.annotate("", centre(end), centre(begin), arrowprops=style)
    corners = np.array([box.get_xy() for box in (*visited, *ends)])
    size = np.array([visited[0].get_width(), visited[0].get_height()])
    low, high = corners.min(axis=0) - size / 2, corners.max(axis=0) + 1.5 * size
    for side, line in enumerate((axes.axvline, axes.axhline)):
        origin, step = visited[0].get_xy()[side], size[side]
        first_edge = origin + np.ceil((low[side] - origin) / step) * step
        for edge in np.arange(first_edge, high[side], step):
            line(edge, color=EDGE, linewidth=0.3, zorder=0)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_xlabel(axis_label(plane.x))
    axes.set_ylabel(axis_label(plane.y))


def _draw_chances(
    axes: Axes, ranking: pd.DataFrame, path: pd.DataFrame, plane: Plane
) -> PatchCollection:
    """Phi of every hypothesis, with the start and the end of the trial."""
    cells = plane.cells(axes, ranking, array=ranking["unconstrained"], cmap=CHANCE)
    cells.set_clim(0, 1)
    points = plane.line(path)
    for point, sign in ((points[0], "o"), (points[-1], "s")):
        axes.plot(*point, sign, color="black", markersize=3.5, markeredgecolor="white")
    plane.dress(axes)
    return cells


def _draw_ranking(
    axes: Axes, ranking: pd.DataFrame, boxes: pd.DataFrame, plane: Plane
) -> PatchCollection:
    """The gain of the hypotheses that no demonstration violates, by its square root; best ranks."""
    feasible = ranking[ranking["feasible"].astype(bool)]
    plane.cells(axes, ranking, facecolor=VIOLATED)
    root = np.sqrt(feasible["gain"])
    cells = plane.cells(axes, feasible, array=root, cmap=GAIN)
    if root.isna().any():
        plane.cells(axes, feasible[root.isna()], facecolor=UNAVOIDABLE)
    cells.set_clim(0, max(float(root.max()), 1e-3))
    best = feasible[(feasible["rank"] <= _NUMBERED) & (feasible["gain"] > 0)]
    for row, box in zip(best.itertuples(), plane.rectangles(best), strict=True):
        numbered(axes, box, row.rank, size=5)
    for box in plane.regions(boxes):
        axes.add_patch(outline(box, TRUTH, 1.6, linestyle="--"))
    plane.dress(axes)
    return cells


def _bar(figure: Figure, axes: Axes, cells: PatchCollection, label: str, power: int) -> None:
    """A colour bar below a panel; the colours stand for values to the power of 1 / `power`."""
    bar = figure.colorbar(cells, ax=axes, location="bottom", aspect=25, pad=0.02)
    ticks = np.linspace(0, cells.get_clim()[1], 3)
    bar.set_ticks(ticks.tolist(), labels=[f"{tick**power:.2g}" for tick in ticks])
    bar.set_label(label)
    bar.outline.set_linewidth(0.5)
