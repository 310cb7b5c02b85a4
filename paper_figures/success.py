"""What a few demonstrations tell of a truth that lies across hypotheses (the paper's Fig. 7)."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from paper_figures.plane import Plane, numbered
from paper_figures.rows import (
    ALL_TASKS,
    DEFAULT,
    Unsuited,
    by_tasks,
    described,
    gain_in_words,
    with_cases,
)
from paper_figures.style import (
    DEMONSTRATION,
    EDGE,
    GUIDE,
    PAGE,
    RC,
    SAMPLED,
    STEP_COLOURS,
    STEP_MARKS,
    TRUTH,
    new_figure,
)

_KEYS = ("truth", "cells", "actions", "dt", "samples")
_ENDS = ("", "_low", "_high")
TABLES = {
    "first_ranking": (
        *("tasks.crossing", "point", *_KEYS, "hypothesis", "feasible", "gain", "rank"),
        *("posterior", "covered_by_truth", "overlaps_truth"),
    ),
    "first_paths": ("tasks.crossing", "truth", "demonstration", "time"),
    "first_violations": ("tasks.crossing", "truth", "trial", "hypothesis"),
    "example_regions": ("truth", "region"),
    "example_dimensions": ("truth", "name", "unit", "lower", "upper", "periodic"),
    "cases": (*_KEYS, "case"),
    "rank_curve": (
        *(*_KEYS, "demonstrations", "seeds"),
        *(
            f"top_{top}_{name}{end}"
            for top in (1, 2)
            for name in ("overlap", "inside")
            for end in _ENDS
        ),
    ),
}
EACH = "truth"
PAPER = 5  # demonstrations of the paper's figure

_BEST = 2  # hypotheses that are outlined
# Colour of the first and the second demonstration, and the hatching of what they violate.
_PAIR = ((DEMONSTRATION, "\\\\\\\\\\"), (SAMPLED, "/////"))
_CURVES = {1: "the best", 2: "both of the best two"}
_COUNTS = (1, 3, 5, 10, 20)  # demonstrations in the caption's facts


def draw(
    first_ranking: pd.DataFrame,
    first_paths: pd.DataFrame,
    first_violations: pd.DataFrame,
    example_regions: pd.DataFrame,
    example_dimensions: pd.DataFrame,
    cases: pd.DataFrame,
    rank_curve: pd.DataFrame,
) -> Figure:
    """Draw a row a kind of tasks: the first demonstrations, and how often inference succeeds.

    Args:
        first_ranking: hypotheses ranked by the first demonstrations, with their corners.
        first_paths: these demonstrations.
        first_violations: the hypotheses that each violates, with corners.
        example_regions: the boxes of the truth.
        example_dimensions: a row a dimension of the state.
        cases: which settings are the default's.
        rank_curve: shares of random sets of demonstrations, a row a number of them.
    """
    if not (first_ranking["overlaps_truth"] & ~first_ranking["covered_by_truth"]).any():
        raise Unsuited("the truth is made of whole hypotheses")
    rows, curves = list(by_tasks(first_ranking)), _default_curves(cases, rank_curve)
    figure, grid = new_figure(
        PAGE,
        0.6 + 2.1 * len(rows),
        nrows=len(rows),
        ncols=3,
        squeeze=False,
        width_ratios=(1.25, 1, 1),
    )
    with plt.rc_context(RC):
        for (words, ranking), (plane_axes, *panels) in zip(rows, grid, strict=True):
            alike = ranking["tasks.crossing"].iloc[0]
            paths, violations = (
                table[table["tasks.crossing"] == alike] for table in (first_paths, first_violations)
            )
            plane = Plane.of(ranking, example_dimensions)
            _draw_plane(plane_axes, ranking, paths, violations, example_regions, plane)
            count = paths["demonstration"].nunique()
            plane_axes.set_title(f"{words}: {count} shown", loc="left")
            for axes, (name, meaning) in zip(
                panels,
                (("overlap", "overlap the truth"), ("inside", "lie inside the truth")),
                strict=True,
            ):
                for place, top in enumerate(_CURVES):
                    _draw_share(axes, _of_tasks(curves, words), f"top_{top}_{name}", place)
                axes.axvline(PAPER, color=GUIDE, linewidth=0.6, linestyle=":")
                axes.set_ylim(-3, 103)
                axes.set_title(meaning, loc="left")
                axes.set_ylabel("sets of demonstrations [%]")
                axes.set_xlabel("demonstrations")
        figure.legend(handles=list(_entries()), loc="outside lower center", ncols=5)
    return figure


def facts(
    first_ranking: pd.DataFrame,
    first_paths: pd.DataFrame,
    first_violations: pd.DataFrame,
    example_regions: pd.DataFrame,
    example_dimensions: pd.DataFrame,
    cases: pd.DataFrame,
    rank_curve: pd.DataFrame,
) -> str:
    """What the caption says."""
    curves = _default_curves(cases, rank_curve)
    lines = [
        "Left: hypotheses, true constraint (filled), the first two demonstrations with the "
        "hypotheses that each violates (hatched), and the two most likely hypotheses after the "
        "first demonstrations (numbered).",
        "Right: share of random sets of demonstrations after which the best hypothesis, or both "
        "of the best two, overlap the true constraint or lie inside it; a tie that is broken at "
        "random counts by its chance.",
        f"Dotted: {PAPER} demonstrations, as in the paper.",
        "Uncertainty: bands are 95 % two-level bootstrap intervals (seeds, then sets).",
    ]
    for words, ranking in by_tasks(first_ranking):
        lines.append(f"{words}: point {ranking['point'].iloc[0]}, {described(ranking)}.")
        for place, row in enumerate(_best(ranking).itertuples(), start=1):
            where = "inside" if row.covered_by_truth else "across" if row.overlaps_truth else "off"
            lines.append(
                f"  {place}: hypothesis {row.hypothesis}, {gain_in_words(row.gain)}, posterior "
                f"{row.posterior:.3g}, {where} the truth"
            )
        curve = _of_tasks(curves, words)
        for row in curve[curve["demonstrations"].isin(_COUNTS)].to_dict("records"):
            shares = ", ".join(
                f"{_CURVES[top]} {name} "
                + "{:.0f} % ({:.0f} to {:.0f})".format(
                    *(100 * row[f"top_{top}_{name}{end}"] for end in _ENDS)
                )
                for name in ("overlap", "inside")
                for top in _CURVES
            )
            several = "s" * (row["demonstrations"] > 1)
            sets = f"{row['demonstrations']} demonstration{several}, {row['seeds']} seeds"
            lines.append(f"  {sets}: {shares}")
    return "\n".join(lines)


def _default_curves(cases: pd.DataFrame, rank_curve: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The rows of the default case, by the kind of tasks in words."""
    joined = with_cases(cases, rank_curve)
    return dict(by_tasks(joined[joined["case"] == DEFAULT]))


def _of_tasks(curves: dict[str, pd.DataFrame], words: str) -> pd.DataFrame:
    """The curve of a kind of tasks, in a study that may have but one."""
    return curves[words if words in curves else ALL_TASKS]


def _best(ranking: pd.DataFrame) -> pd.DataFrame:
    """The best hypotheses that gain anything, be it more than any number."""
    ordered = ranking[~(ranking["gain"] <= 0)].sort_values(["rank", "hypothesis"], kind="stable")
    return ordered.head(_BEST)


def _draw_plane(
    axes: Axes,
    ranking: pd.DataFrame,
    paths: pd.DataFrame,
    violations: pd.DataFrame,
    regions: pd.DataFrame,
    plane: Plane,
) -> None:
    """The truth, two demonstrations with what they violate, the best two hypotheses."""
    plane.cells(axes, ranking, facecolor="none", zorder=1)
    for box in plane.regions(regions):
        box.set(facecolor=TRUTH, alpha=0.75, linewidth=0, zorder=2)
        axes.add_patch(box)
    trials = sorted(paths["demonstration"].unique())[: len(_PAIR)]
    for trial, (colour, hatch) in zip(trials, _PAIR, strict=False):
        path = plane.line(paths[paths["demonstration"] == trial])
        boxes = violations[violations["trial"] == trial]
        style = {"facecolor": "none", "edgecolor": colour, "linewidth": 0}
        plane.cells(axes, boxes, hatch=hatch, zorder=3, **style)
        axes.plot(*path.T, color=colour, linewidth=1.4, zorder=5)
        axes.plot(*path[0], "o", color=colour, markersize=4, markeredgecolor="white", zorder=6)
        axes.plot(*path[-1], "s", color=colour, markersize=4, markeredgecolor="white", zorder=6)
    best = _best(ranking)
    for place, box in enumerate(plane.rectangles(best), start=1):
        numbered(axes, box, place)
    plane.dress(axes)


def _draw_share(axes: Axes, curve: pd.DataFrame, name: str, place: int) -> None:
    """A share in percent against the number of demonstrations, with its interval."""
    colour, mark = STEP_COLOURS[2 - 2 * place], STEP_MARKS[place]
    middle, low, high = (100 * curve[name + end] for end in _ENDS)
    axes.fill_between(curve["demonstrations"], low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(curve["demonstrations"], middle, color=colour, marker=mark, markevery=(place, 2))
    ticks = [count for count in _COUNTS if count <= curve["demonstrations"].max()]
    axes.set_xticks(ticks)


def _entries() -> Iterator[object]:
    """What the signs mean."""
    for (colour, hatch), words in zip(_PAIR, ("first", "second"), strict=True):
        yield Line2D([], [], color=colour, linewidth=1.4, label=f"{words} demonstration")
        patch = {"facecolor": "white", "edgecolor": colour, "linewidth": 0.3}
        yield Patch(hatch=hatch, label="it violates", **patch)
    yield Patch(facecolor=TRUTH, alpha=0.75, label="true constraint")
    yield Patch(facecolor="white", edgecolor="black", linewidth=1.0, label="best two hypotheses")
    for place, words in enumerate(_CURVES.values()):
        style = {"color": STEP_COLOURS[2 - 2 * place], "marker": STEP_MARKS[place]}
        yield Line2D([], [], label=words, **style)
    yield Patch(facecolor="white", edgecolor=EDGE, linewidth=0.5, label="hypothesis")
