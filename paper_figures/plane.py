"""The plane of two state dimensions in which boxes, cells and paths are drawn."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.patches import Rectangle
from matplotlib.path import Path
from matplotlib.transforms import IdentityTransform, Transform

from paper_figures.rows import Unsuited
from paper_figures.style import EDGE

_TURN_TICKS = {0.0: "0", 0.25: r"$\pi/2$", 0.5: r"$\pi$", 0.75: r"$3\pi/2$", 1.0: r"$2\pi$"}


class Shaped(Rectangle):
    """The outline of a region that is no box, in place of the rectangle around it.

    Attributes:
        rings: closed polylines (P, 2) in the plane; holes run the other way round.
    """

    def __init__(self, *size: Any, rings: list[np.ndarray], **style: Any) -> None:
        super().__init__(*size, **style)
        self.rings = rings

    def get_path(self) -> Path:
        """The rings, in the coordinates of the axes."""
        return Path.make_compound_path(*(Path(ring, closed=True) for ring in self.rings))

    def get_patch_transform(self) -> Transform:
        """None: rings lie where they are drawn."""
        return IdentityTransform()


@dataclass(frozen=True, eq=False)
class Plane:
    """Two dimensions of the state, each a row of the table `dimensions`.

    Attributes:
        x: name, unit, lower, upper and periodic of the horizontal one.
        y: of the vertical one.
    """

    x: pd.Series
    y: pd.Series

    @classmethod
    def of(cls, boxes: pd.DataFrame, dimensions: pd.DataFrame) -> Plane:
        """The first two dimensions that boxes bound, or, where they bound one, that and another.

        Raises:
            Unsuited: the state has but one.
        """
        if len(dimensions) < 2:
            raise Unsuited("a state of one dimension has no plane")
        free = [not np.isfinite(boxes[f"lower_{name}"]).any() for name in dimensions["name"]]
        order = np.argsort(free, kind="stable")[:2]
        return cls(*(dimensions.iloc[place] for place in sorted(order)))

    def rectangles(self, boxes: pd.DataFrame) -> list[Rectangle]:
        """Each box, of columns lower_<d> and upper_<d>; a free side spans the axis.

        A region that is no box has rings in the column `outline`, and is drawn by them.
        """
        corners = [
            boxes[[f"{side}_{self.x['name']}", f"{side}_{self.y['name']}"]].to_numpy(dtype=float)
            for side in ("lower", "upper")
        ]
        lower, upper = (
            np.where(np.isfinite(corner), corner, [self.x[side], self.y[side]])
            for corner, side in zip(corners, ("lower", "upper"), strict=True)
        )
        outlines = boxes.get("outline", pd.Series("", boxes.index)).fillna("")
        names = [self.x["name"], self.y["name"]]
        return [
            Shaped(tuple(a), *(b - a), rings=rings)
            if text and (rings := outline_rings(text, names))
            else Rectangle(tuple(a), *(b - a))
            for a, b, text in zip(lower, upper, outlines, strict=True)
        ]

    def line(self, path: pd.DataFrame) -> np.ndarray:
        """(K, 2) the points of a path, with a row of NaN wherever a periodic dimension wraps."""
        points = path[[self.x["name"], self.y["name"]]].to_numpy(dtype=float).copy()
        for column, dimension in enumerate((self.x, self.y)):
            if dimension["periodic"]:
                period = dimension["upper"] - dimension["lower"]
                wrapped = dimension["lower"] + (points[:, column] - dimension["lower"]) % period
                points[:, column] = wrapped
                jump = np.abs(np.diff(wrapped)) > period / 2
                points = np.insert(points, np.flatnonzero(jump) + 1, np.nan, axis=0)
        return points

    def cells(self, axes: Axes, boxes: pd.DataFrame, **style: Any) -> PatchCollection:
        """Draw boxes, their edges thin, coloured by `array` if one is given."""
        patches = self.rectangles(boxes) if "array" in style else self.regions(boxes)
        collection = PatchCollection(patches, **{"edgecolor": EDGE, "linewidth": 0.3, **style})
        axes.add_collection(collection)
        return collection

    def shadows(self, boxes: pd.DataFrame) -> pd.DataFrame:
        """One box of each place in the plane: those of further dimensions lie on one another."""
        corner = [f"lower_{dimension['name']}" for dimension in (self.x, self.y)]
        return boxes.drop_duplicates(corner)

    def regions(self, boxes: pd.DataFrame) -> list[Rectangle]:
        """Each box, and its copies where it leaves a periodic dimension on one side."""
        pieces = self.rectangles(boxes)
        for column, dimension in enumerate((self.x, self.y)):
            if dimension["periodic"]:
                period = dimension["upper"] - dimension["lower"]
                pieces = [
                    copy for box in pieces for copy in _copies(box, column, dimension, period)
                ]
        return pieces

    def beside(self, box: Rectangle, other: Rectangle) -> Rectangle:
        """A box moved by whole periods to where its centre is nearest to that of another."""
        corner = list(box.get_xy())
        for column, dimension in enumerate((self.x, self.y)):
            if dimension["periodic"]:
                period = dimension["upper"] - dimension["lower"]
                ahead = (centre(box)[column] - centre(other)[column]) / period
                corner[column] -= np.round(ahead) * period
        return Rectangle(tuple(corner), box.get_width(), box.get_height())

    def dress(self, axes: Axes) -> None:
        """Set limits and labels with units; a whole turn in radians has ticks by its quarters."""
        axes.set_xlim(self.x["lower"], self.x["upper"])
        axes.set_ylim(self.y["lower"], self.y["upper"])
        axes.set_xlabel(axis_label(self.x))
        axes.set_ylabel(axis_label(self.y))
        for dimension, axis in ((self.x, axes.xaxis), (self.y, axes.yaxis)):
            turn = dimension["upper"] - dimension["lower"]
            if (
                dimension["unit"] == "rad"
                and dimension["lower"] == 0
                and np.isclose(turn, 2 * np.pi)
            ):
                axis.set_ticks([turn * share for share in _TURN_TICKS], list(_TURN_TICKS.values()))


def _copies(
    box: Rectangle, column: int, dimension: pd.Series, period: float
) -> Iterator[Rectangle]:
    """A box and those of its copies, a period before and after, that reach into the bounds.

    The rings of a region that is no box are all of them.
    """
    if isinstance(box, Shaped):
        yield box
        return
    size = (box.get_width(), box.get_height())
    slack = 1e-5 * period  # tables round corners
    for turns in (0, -1, 1):
        corner = list(box.get_xy())
        corner[column] += turns * period
        inside = corner[column] < dimension["upper"] - slack
        if inside and corner[column] + size[column] > dimension["lower"] + slack:
            yield Rectangle(tuple(corner), *size)


def outline_rings(text: str, names: list[str]) -> list[np.ndarray]:
    """The rings of an outline in a table, if it is one in the plane of two dimensions."""
    written = json.loads(text)
    if written["dimensions"] != names:
        return []
    return [np.array(ring, dtype=float) for ring in written["rings"]]


def centre(box: Rectangle) -> tuple[float, float]:
    """The middle of a box."""
    return (box.get_x() + box.get_width() / 2, box.get_y() + box.get_height() / 2)


def axis_label(dimension: pd.Series) -> str:
    """The name of a dimension with its unit."""
    return f"{dimension['name'].replace('_', ' ')} [{dimension['unit']}]"


def outline(box: Rectangle, colour: str, width: float, **options: Any) -> Rectangle:
    """The border of a box, above what fills it."""
    style: dict[str, Any] = {"fill": False, "edgecolor": colour, "linewidth": width, "zorder": 4}
    size = box.get_xy(), box.get_width(), box.get_height()
    if isinstance(box, Shaped):
        return Shaped(*size, rings=box.rings, **{**style, **options})
    return Rectangle(*size, **{**style, **options})


def numbered(axes: Axes, box: Rectangle, number: float, size: float = 7) -> None:
    """Outline a box and write its rank into it, on white."""
    axes.add_patch(outline(box, "black", 1.0))
    plate = {"boxstyle": "circle,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8}
    style = {"fontsize": size, "fontweight": "bold", "bbox": plate, "zorder": 5}
    axes.text(*centre(box), f"{number:g}", ha="center", va="center", **style)
