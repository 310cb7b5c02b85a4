"""Points of shapes, and what they tell: how large a shape is, and which others hold it.

The points are 4096 of an additive recurrence (Roberts 2018), spread evenly over the part of the
shape's hull that is in the bounds, and the corners of a box. So what is told of shapes that are no
boxes is right to about 1/1000 of the hull's volume.
"""

from __future__ import annotations

import numpy as np

from mlci.shapes.shape import Cuboid, Shape
from mlci.spaces import Box, Floats, StateSpace

_POINTS = 4096
_BORDER = 1e-9  # of the widest bound: rounding may put a point of a common border beyond it


def points_of(space: StateSpace, shape: Shape) -> Floats:
    """Points (P, n) of a shape within the bounds; there may be none."""
    box = _hull_within(space, shape)
    if not np.all(box.widths > 0):
        return np.empty((0, space.dimension))
    points = spread_points(box)
    if isinstance(shape, Cuboid):
        return np.concatenate([points, box.vertices()])
    return points[shape.level(space, points) < 0]


def volume_share(space: StateSpace, shape: Shape) -> float:
    """The share of the state space's volume that a shape holds; see the module's head."""
    box = _hull_within(space, shape)
    if not np.all(box.widths > 0):
        return 0.0
    inside = np.mean(shape.level(space, spread_points(box)) < 0)
    return float(inside * np.prod(box.widths / space.bounds.widths))


def deepest_level(space: StateSpace, shape: Shape) -> float:
    """The lowest level of a shape within the bounds, below 0 unless it is too small for points."""
    return float(np.min(shape.level(space, points_of(space, shape)), initial=0.0))


def covered_by_points(space: StateSpace, shape: Shape, other: Shape) -> bool:
    """Whether another shape, its border included, holds all points of a shape that has some."""
    points = points_of(space, shape)
    slack = _BORDER * np.max(space.bounds.widths)
    return len(points) > 0 and bool(np.all(other.level(space, points) <= slack))


def shared_by_points(space: StateSpace, shape: Shape, other: Shape) -> bool:
    """Whether one of two shapes holds a point of the other in its interior."""
    slack = _BORDER * np.max(space.bounds.widths)
    return any(
        bool(np.any(one.level(space, points_of(space, another)) < -slack))
        for one, another in ((other, shape), (shape, other))
    )


def _hull_within(space: StateSpace, shape: Shape) -> Box:
    """The part of a shape's hull that is in the bounds: it may go round a periodic dimension."""
    hull, bounds = shape.hull(space), space.bounds
    all_round = space.periodic & (hull.widths >= bounds.widths)
    lower = np.where(space.periodic, hull.lower, np.maximum(hull.lower, bounds.lower))
    upper = np.where(space.periodic, hull.upper, np.minimum(hull.upper, bounds.upper))
    lower, upper = (
        np.where(all_round, bound, side)
        for bound, side in ((bounds.lower, lower), (bounds.upper, upper))
    )
    return Box(np.minimum(lower, upper), upper)


def spread_points(box: Box, count: int = _POINTS) -> Floats:
    """Points (count, n) spread evenly over a finite box."""
    ratio = 2.0
    for _ in range(60):  # the positive root of x^(n + 1) = x + 1
        ratio = (1 + ratio) ** (1 / (box.dimension + 1))
    shares = (0.5 + np.outer(np.arange(count), ratio ** -np.arange(1.0, box.dimension + 1))) % 1
    return box.lower + shares * box.widths
