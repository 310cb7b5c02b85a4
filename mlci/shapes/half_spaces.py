"""Half-spaces: all that lies beyond a plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.shapes.shape import Shape
from mlci.shapes.spans import Spans
from mlci.spaces import Box, Floats, StateSpace


@dataclass(frozen=True, eq=False)
class HalfSpace(Shape):
    """States with normal . x > offset; its level is the signed distance.

    Attributes:
        normal: (n,) points into the region; 0 in dimensions that do not count.
        offset: in the unit of normal . x.

    Raises:
        ValueError: a normal that is 0, or numbers that are not finite.
    """

    normal: Floats
    offset: float

    def __init__(self, normal: ArrayLike, offset: float) -> None:
        direction = np.array(normal, dtype=float)
        if direction.ndim != 1 or not np.all(np.isfinite(direction)) or not np.any(direction):
            raise ValueError(f"a half-space needs a finite normal (n,), not all 0, not {normal!r}")
        if not np.isfinite(offset):
            raise ValueError(f"a half-space needs a finite offset, not {offset}")
        object.__setattr__(self, "normal", direction)
        object.__setattr__(self, "offset", float(offset))

    def check(self, space: StateSpace) -> None:
        """See `Shape.check`: there is no half of a dimension that wraps."""
        if len(self.normal) != space.dimension:
            raise ValueError(
                f"a half-space needs a normal of {space.dimension} dimensions, not "
                f"{self.normal.tolist()}"
            )
        for d in np.flatnonzero(space.periodic & (self.normal != 0)):
            raise ValueError(
                f"{space.names[d]} wraps, so that it has no half-space: give the normal 0 there, "
                "or take a box"
            )

    def level(self, space: StateSpace, states: Floats) -> Floats:
        """The signed distance."""
        return np.asarray((self.offset - states @ self.normal) / np.linalg.norm(self.normal))

    def spans(self, space: StateSpace, starts: Floats, steps: Floats) -> Spans:
        """See `Shape.spans`; the root of a linear function."""
        beyond, rise = starts @ self.normal - self.offset, steps @ self.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.where(rise == 0, 0.0, -beyond / rise)
        inside = (beyond > 0) | (beyond + rise > 0)
        enter = np.where((rise > 0) & (beyond <= 0), root, 0.0)
        leave = np.where(rise < 0, root, 1.0)
        chord = np.flatnonzero(inside & np.isfinite(rise))
        return Spans.of(len(starts), chord, enter[chord], leave[chord])

    def hull(self, space: StateSpace) -> Box:
        """What it can hold of the bounds in the dimensions of its normal."""
        counts, bounds = self.normal != 0, space.bounds
        most = np.maximum(self.normal * bounds.lower, self.normal * bounds.upper)
        with np.errstate(divide="ignore", invalid="ignore"):
            side = (self.offset - (np.sum(most) - most)) / self.normal
        side = np.clip(side, bounds.lower, bounds.upper)
        lower = np.where(self.normal > 0, side, bounds.lower)
        upper = np.where(self.normal < 0, side, bounds.upper)
        return Box(np.where(counts, lower, -np.inf), np.where(counts, upper, np.inf))
