"""Shapes that a forbidden area may have, drawn from a prior: ellipsoids or boxes along the axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mlci.regions import Regions
from mlci.shapes.balls import Ball
from mlci.spaces import Bools, Box, StateSpace


def draw_shapes(
    space: StateSpace,
    count: int,
    smallest: float,
    largest: float,
    rng: np.random.Generator,
    *,
    free: ArrayLike | None = None,
    boxes: bool = False,
) -> Regions:
    """Ellipsoids whose centres and half widths are uniform, each dimension by itself.

    Args:
        space: their space; what of a shape reaches beyond its bounds does not count.
        count: C, of the shapes.
        smallest: least half width, as a share of a dimension's range.
        largest: largest half width, likewise.
        rng: of the draws.
        free: (n,) dimensions that no shape bounds; none by default.
        boxes: boxes of these half widths in place of ellipsoids.

    Raises:
        ValueError: no shapes, half widths that are not 0 < smallest <= largest <= 1/2, or no
            dimension that is bounded.
    """
    if count < 1:
        raise ValueError(f"at least one shape is drawn, not {count}")
    if not 0 < smallest <= largest <= 0.5:
        raise ValueError(
            "half widths of shapes need 0 < smallest <= largest <= 0.5 of a range, not "
            f"{smallest} and {largest}"
        )
    is_free = np.zeros(space.dimension, bool) if free is None else np.asarray(free, dtype=bool)
    if is_free.shape != (space.dimension,) or is_free.all():
        raise ValueError(f"{space.dimension} dimensions, one of them bounded, not free {is_free}")
    bounds = space.bounds
    centers = rng.uniform(bounds.lower, bounds.upper, (count, space.dimension))
    halves = rng.uniform(smallest, largest, (count, space.dimension)) * bounds.widths
    halves[:, is_free] = np.inf
    if boxes:
        each = zip(centers, halves, strict=True)
        return Regions.from_shapes(space, [Box(at - half, at + half) for at, half in each])
    return Regions.from_shapes(space, map(Ball, centers, halves))


def apart(inside: Bools) -> Bools:
    """(C, C) which pairs of shapes share no point.

    Args:
        inside: (P, C) which points lie in each shape, such as `ShapeEvidence.inside`.
    """
    points = inside.astype(np.float32)
    return np.asarray(points.T @ points == 0)
