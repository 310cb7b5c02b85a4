"""How well sets of hypotheses cover a truth that is larger than any: a map, and overlap by number
of demonstrations."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from paper_figures.plane import Plane
from paper_figures.rows import Unsuited
from paper_figures.style import CHANCE, EDGE, GUIDE, PAGE, RC, SIX_COLOURS, STEP_COLOURS, new_figure

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
    "likeliest": "most probable shapes",
    "shapes": "best area of shapes",
    "chosen": "best area, chosen tasks",
    "ideal": "random tasks, all assumptions right",
    "ideal_chosen": "chosen tasks, all assumptions right",
    "shown": "all of the truth that was shown",
}
CEILINGS = ("ideal", "ideal_chosen", "shown")  # they know more than demonstrations tell
# What is drawn; the others are in the report.
_LOOKS = {
    "single": (STEP_COLOURS[0], "o", "-"),
    "greedy": (STEP_COLOURS[1], "s", "-"),
    "climb": (STEP_COLOURS[2], "^", "-"),
    "shapes": (STEP_COLOURS[3], "D", "-"),
    "chosen": (SIX_COLOURS[2], "v", "-"),
    "ideal": (GUIDE, "", "--"),
    "ideal_chosen": (GUIDE, "", "-."),
    "shown": (GUIDE, "", ":"),
}


def shown_column(area_map: pd.DataFrame) -> str:
    """The column of areas that is drawn: of shapes where there are any, of so many SHOWN."""
    there = area_map.dropna(axis="columns", how="all")
    for method in ("shapes", "climb"):
        opening = f"{method}_"
        sizes = [int(name.removeprefix(opening)) for name in there if name.startswith(opening)]
        if sizes:
            size = max((size for size in sizes if size <= SHOWN), default=min(sizes))
            return f"{opening}{size}"
    raise Unsuited("no area was inferred")


def draw(
    area_curve: pd.DataFrame,
    area_map: pd.DataFrame,
    hypotheses: pd.DataFrame,
    regions: pd.DataFrame,
    dimensions: pd.DataFrame,
) -> Figure:
    """Draw how often each hypothesis belongs to the set, the truth over it, and the overlap."""
    column = shown_column(area_map)
    share = 100 * area_map.groupby("hypothesis")[column].mean()
    cells = hypotheses.drop_duplicates("hypothesis").sort_values("hypothesis")
    plane = Plane.of(cells, dimensions)
    figure, (left, right) = new_figure(PAGE, 3.3, ncols=2)
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
        figure.colorbar(scale, ax=left, label="in the inferred area, mean [%]", shrink=0.85)
        for name, (colour, mark, line) in _LOOKS.items():
            curve = area_curve[area_curve["method"] == name].sort_values("demonstrations")
            if curve.empty:
                continue
            number = curve["demonstrations"]
            look = {"color": colour, "marker": mark, "linestyle": line}
            right.plot(number, curve["iou"], label=METHODS[name], **look)
            if name in CEILINGS:  # without bands
                continue
            right.fill_between(
                number, curve["iou_low"], curve["iou_high"], color=colour, alpha=0.15, linewidth=0
            )
        right.axhline(AIM, color=GUIDE, linewidth=0.8, zorder=0)
        right.set_xscale("log", base=2)
        sizes = sorted(area_curve["demonstrations"].unique())
        right.set_xticks(sizes, labels=[str(size) for size in sizes])
        right.set_ylim(0, 1.02)
        right.set_xlabel("demonstrations")
        right.set_ylabel("overlap with the truth, IoU [1]")
        figure.legend(loc="outside lower center", ncols=3)
    return figure


def facts(
    area_curve: pd.DataFrame,
    area_map: pd.DataFrame,
    hypotheses: pd.DataFrame,
    regions: pd.DataFrame,
    dimensions: pd.DataFrame,
) -> str:
    """What the caption says."""
    method, size = shown_column(area_map).split("_")
    lines = [
        f"Left: share of each hypothesis that is in the area inferred from {size} demonstrations "
        f"({METHODS[method]}), mean over random subsets of them; outlined: boxes that hold the "
        "regions of the truth, each of which may be smaller than its box.",
        "Right: intersection over union with the truth; bands: 95 % bootstrap intervals over seeds "
        f"and subsets; horizontal: {AIM:g}. Ceilings: what of the truth was in the way of the "
        "tasks; and worlds in which all that inference assumes is right.",
    ]
    for row in area_curve.itertuples():
        lines.append(
            f"  {METHODS[row.method]}, {row.demonstrations}: {row.iou:.2f} ({row.iou_low:.2f} to "
            f"{row.iou_high:.2f})"
        )
    return "\n".join(lines)
