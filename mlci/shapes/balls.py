"""Balls and ellipsoids, in any subset of the dimensions."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.shapes.shape import Shape
from mlci.shapes.spans import Spans
from mlci.spaces import Box, Floats, StateSpace


@dataclass(frozen=True, eq=False)
class Ball(Shape):
    """An ellipsoid along the axes: sum over d of ((x_d - center_d) / radius_d)^2 < 1.

    Its level is (|z| - 1) times the least radius, z being the offset in radii: the signed distance
    where all radii are equal, and below it elsewhere.

    Attributes:
        center: (n,) its centre.
        radii: (n,) semi-axes in the units of the state, one number for all; inf leaves a dimension
            free.

    Raises:
        ValueError: lengths that differ, a centre that is not finite, a radius that is not positive,
            or only infinite ones.
    """

    center: Floats
    radii: Floats

    def __init__(self, center: ArrayLike, radii: ArrayLike) -> None:
        middle, axes = np.array(center, dtype=float), np.array(radii, dtype=float)
        if middle.ndim != 1 or axes.shape not in ((), middle.shape):
            raise ValueError(
                f"a ball needs a radius for each of {middle.shape} centres, not {axes.shape}"
            )
        axes = np.broadcast_to(axes, middle.shape).copy()
        if not np.all(axes > 0) or not np.any(np.isfinite(axes)):
            raise ValueError(f"a ball needs positive radii, one of them finite, not {axes}")
        if not np.all(np.isfinite(middle)):
            raise ValueError(f"a ball needs a finite centre, not {middle}")
        object.__setattr__(self, "center", middle)
        object.__setattr__(self, "radii", axes)

    def check(self, space: StateSpace) -> None:
        """See `Shape.check`."""
        if len(self.center) != space.dimension:
            raise ValueError(
                f"a ball needs a centre of {space.dimension} dimensions, not {self.center.tolist()}"
            )

    def level(self, space: StateSpace, states: Floats) -> Floats:
        """See the class."""
        away = np.linalg.norm(space.difference(states, self.center) / self.radii, axis=-1)
        return np.asarray((away - 1) * np.min(self.radii))

    def spans(self, space: StateSpace, starts: Floats, steps: Floats) -> Spans:
        """See `Shape.spans`; the roots of |z + share dz| = 1, for each image of the ball."""
        by_share, parts = steps / self.radii, []
        square = np.sum(by_share**2, axis=1)
        for shift in itertools.product(*(self._shifts(space, d) for d in range(len(self.center)))):
            offset = (starts - self.center - np.array(shift)) / self.radii
            half, rest = np.sum(offset * by_share, axis=1), np.sum(offset**2, axis=1) - 1
            # To the nearest point, and from there to the border: squares do not cancel so.
            with np.errstate(divide="ignore", invalid="ignore"):
                middle = np.where(square > 0, -half / square, 0.0)
                nearest = np.sum((offset + middle[:, None] * by_share) ** 2, axis=1)
                reach = np.where(square > 0, np.sqrt((1 - nearest) / square), np.inf)
            inside = np.flatnonzero(np.where(square > 0, nearest < 1, rest < 0))
            enter, leave = middle[inside] - reach[inside], middle[inside] + reach[inside]
            parts.append(Spans.of(len(starts), inside, enter, leave))
        return Spans.joined(parts)

    def hull(self, space: StateSpace) -> Box:
        """The box that the ball touches on all sides."""
        free = np.isinf(self.radii)
        lower = np.where(free, -np.inf, self.center - self.radii)
        return Box(lower, np.where(free, np.inf, self.center + self.radii))

    def _shifts(self, space: StateSpace, d: int) -> Floats:
        """How far away the images of the ball are that a wrapped chord can reach."""
        if not space.periodic[d] or np.isinf(self.radii[d]):
            return np.zeros(1)
        bounds, period = space.bounds, space.bounds.widths[d]
        first = (bounds.lower[d] - period / 2 - self.center[d] - self.radii[d]) / period
        last = (bounds.upper[d] + period / 2 - self.center[d] + self.radii[d]) / period
        return np.arange(np.ceil(first), np.floor(last) + 1) * period
