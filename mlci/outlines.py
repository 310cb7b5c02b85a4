"""Outlines of regions that are no boxes, in the plane of two state dimensions, for pictures.

The level of a shape is looked at on a lattice over its hull, and its outline is where that is 0.
Of more than two dimensions the shadow is drawn: a place of the plane belongs to it if the shape
holds a state above it, looked for at 64 values of the other dimensions.
"""

from __future__ import annotations

import itertools
from typing import Any

import contourpy
import numpy as np

from mlci.planes import Plane
from mlci.shapes.membership import spread_points
from mlci.shapes.shape import Shape
from mlci.spaces import Box, Floats

_SIDE = 121  # lattice points along each side
_ABOVE = 64  # values of the other dimensions


def outline(plane: Plane, shape: Shape) -> list[Floats]:
    """Closed rings (P, 2) in the plane; holes run the other way round than what they are holes in.

    A shape of one dimension is a band from 0 to 1.
    """
    box = _window(plane, shape)
    sides = [np.linspace(box.lower[d], box.upper[d], _SIDE) for d in (plane.x, plane.y or 0)]
    x, y = np.meshgrid(sides[0], [0.0, 1.0] if plane.y is None else sides[1])
    others = [d for d in range(plane.space.dimension) if d not in (plane.x, plane.y)]
    values = spread_points(box, _ABOVE) if others else np.zeros((1, plane.space.dimension))
    level = np.full(x.shape, np.inf)
    for value in values:
        states = np.broadcast_to(value, (*x.shape, plane.space.dimension)).copy()
        states[..., plane.x] = x
        if plane.y is not None:
            states[..., plane.y] = y
        level = np.minimum(level, shape.level(plane.space, states))
    lines = contourpy.contour_generator(x, y, level, fill_type="OuterOffset")
    filled: Any = lines.filled(-np.finfo(float).max, 0.0)
    points, offsets = filled
    return [
        np.asarray(polygon[first:last])
        for polygon, ends in zip(points, offsets, strict=True)
        for first, last in itertools.pairwise(ends)
    ]


def _window(plane: Plane, shape: Shape) -> Box:
    """What of a shape's hull is in the bounds, a little wider; all of them where it goes round."""
    bounds, hull = plane.space.bounds, shape.hull(plane.space)
    wider = 0.02 * np.where(np.isfinite(hull.widths), hull.widths, 0.0)
    lower, upper = hull.lower - wider, hull.upper + wider
    round_it = plane.space.periodic & ((lower < bounds.lower) | (upper > bounds.upper))
    lower = np.where(round_it, bounds.lower, np.maximum(lower, bounds.lower))
    return Box(lower, np.where(round_it, bounds.upper, np.minimum(upper, bounds.upper)))
