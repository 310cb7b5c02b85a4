"""How well sets of hypotheses cover a truth that is larger than any: a map, and overlap by number
of demonstrations."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from paper_figures.plane import Plane
from paper_figures.style import CHANCE, EDGE, GUIDE, PAGE, RC, STEP_COLOURS, STEP_MARKS, new_figure

TABLES = {
    "area_curve": ("demonstrations", "method", "iou", "iou_low", "iou_high"),
    "area_map": ("seed", "hypothesis", "in_truth"),
    "hypotheses": ("seed", "hypothesis"),
    "regions": ("truth", "region"),
    "dimensions": ("truth", "name", "unit", "lower", "upper", "periodic"),
}

AIM = 0.6  # of the overlap
SHOWN = 4  # demonstrations of the map, or the most that there are below
METHODS = {
    "single": "best hypothesis",
    "neighbourhood": "most probable area",
    "greedy": "greedy, 0.1 nat",
    "climb": "posterior of the set",
}


def shown_size(area_map: pd.DataFrame) -> int:
    """The number of demonstrations whose areas are drawn."""
    climbs = area_map.filter(regex="^climb_").dropna(axis="columns", how="all")
    sizes = [int(name.removeprefix("climb_")) for name in climbs]
    return max((size for size in sizes if size <= SHOWN), default=min(sizes))


def draw(
    area_curve: pd.DataFrame,
    area_map: pd.DataFrame,
    hypotheses: pd.DataFrame,
    regions: pd.DataFrame,
    dimensions: pd.DataFrame,
) -> Figure:
    """Draw how often each hypothesis belongs to the set, the truth over it, and the overlap."""
    column = f"climb_{shown_size(area_map)}"
    share = 100 * area_map.groupby("hypothesis")[column].mean()
    cells = hypotheses.drop_duplicates("hypothesis").sort_values("hypothesis")
    plane = Plane.of(cells, dimensions)
    figure, (left, right) = new_figure(PAGE, 2.9, ncols=2)
    with plt.rc_context(RC):
        scale = ScalarMappable(Normalize(0, 100), CHANCE)
        for box, value in zip(plane.rectangles(cells), share, strict=True):
            box.set(facecolor=scale.to_rgba(value), edgecolor=EDGE, linewidth=0.3)
            left.add_patch(box)
        for outline in plane.regions(regions):
            outline.set(facecolor="none", edgecolor="black", linewidth=1.2, zorder=3)
            left.add_patch(outline)
        plane.dress(left)
        left.set_aspect("equal")
        figure.colorbar(scale, ax=left, label="subsets whose set has it [%]", shrink=0.85)
        for (name, label), colour, mark in zip(
            METHODS.items(), STEP_COLOURS, STEP_MARKS, strict=True
        ):
            curve = area_curve[area_curve["method"] == name].sort_values("demonstrations")
            right.plot(
                curve["demonstrations"], curve["iou"], color=colour, marker=mark, label=label
            )
            right.fill_between(
                curve["demonstrations"],
                curve["iou_low"],
                curve["iou_high"],
                color=colour,
                alpha=0.15,
                linewidth=0,
            )
        right.axhline(AIM, color=GUIDE, linewidth=0.8, linestyle=":", zorder=0)
        right.set_xscale("log", base=2)
        sizes = sorted(area_curve["demonstrations"].unique())
        right.set_xticks(sizes, labels=[str(size) for size in sizes])
        right.set_ylim(0, 1)
        right.set_xlabel("demonstrations")
        right.set_ylabel("overlap with the truth, IoU [1]")
        right.legend(loc="upper left")
    return figure


def facts(
    area_curve: pd.DataFrame,
    area_map: pd.DataFrame,
    hypotheses: pd.DataFrame,
    regions: pd.DataFrame,
    dimensions: pd.DataFrame,
) -> str:
    """What the caption says."""
    lines = [
        f"Left: share of random subsets of {shown_size(area_map)} demonstrations in whose set a "
        "hypothesis is (posterior of the set, climbed); outlined: boxes that hold the regions of "
        "the truth, each of which may be smaller than its box.",
        "Right: intersection over union with the truth; bands: 95 % bootstrap intervals over seeds "
        f"and subsets; dotted: {AIM:g}.",
    ]
    for row in area_curve.itertuples():
        lines.append(
            f"  {METHODS[row.method]}, {row.demonstrations}: {row.iou:.2f} ({row.iou_low:.2f} to "
            f"{row.iou_high:.2f})"
        )
    return "\n".join(lines)
