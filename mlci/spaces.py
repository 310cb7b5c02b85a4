"""Boxes and state spaces: the geometry that everything else measures with."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Box:
    """An axis-aligned box; an infinite side leaves that dimension free.

    Attributes:
        lower: (n,) lower corner.
        upper: (n,) upper corner; equal to `lower` in every dimension for a point.

    Raises:
        ValueError: corners of different shapes, NaN, or a lower side above its upper side.
    """

    lower: Floats
    upper: Floats

    def __post_init__(self) -> None:
        lower = np.atleast_1d(np.array(self.lower, dtype=float))
        upper = np.atleast_1d(np.array(self.upper, dtype=float))
        if lower.ndim != 1 or lower.shape != upper.shape:
            raise ValueError(
                f"a box needs two corners of one length, not {lower.shape} and {upper.shape}"
            )
        if not np.all(lower <= upper):
            raise ValueError(f"a box needs lower <= upper, not {lower} and {upper}")
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)

    @classmethod
    def point(cls, state: ArrayLike) -> Box:
        """The box that holds one point (n,)."""
        return cls(np.asarray(state, float), np.asarray(state, float))

    @property
    def dimension(self) -> int:
        return len(self.lower)

    @property
    def widths(self) -> Floats:
        """(n,) side lengths."""
        return self.upper - self.lower

    def contains(self, points: ArrayLike) -> Bools:
        """Whether each of points (..., n) lies in the closed box."""
        points = np.asarray(points)
        return np.all((points >= self.lower) & (points <= self.upper), axis=-1)

    def vertices(self) -> Floats:
        """(2^n, n) corners, for example the extremal controls of a control box."""
        return np.array(list(itertools.product(*zip(self.lower, self.upper, strict=True))))


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A bounded box of states, some of whose dimensions may be periodic.

    Attributes:
        bounds: finite box; a periodic dimension's period is its side length.
        periodic: (n,) which dimensions wrap.
        names: (n,) name of each dimension, for tables, files and axes.
        units: (n,) unit of each dimension.

    Raises:
        ValueError: bounds that are not finite or empty, or lengths that differ.
    """

    bounds: Box
    periodic: Bools
    names: tuple[str, ...]
    units: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        periodic = np.atleast_1d(np.array(self.periodic, dtype=bool))
        names, n = tuple(self.names), self.bounds.dimension
        units = tuple(self.units) or ("",) * n
        if not (len(periodic) == len(names) == len(units) == n):
            raise ValueError(
                f"a state space of {n} dimensions needs as many periodic flags, names and units, "
                f"not {len(periodic)}, {len(names)} and {len(units)}"
            )
        if not np.all(np.isfinite(self.bounds.widths) & (self.bounds.widths > 0)):
            raise ValueError(f"state bounds must be finite and not empty: {self.bounds}")
        object.__setattr__(self, "periodic", periodic)
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "units", units)

    @property
    def dimension(self) -> int:
        return self.bounds.dimension

    @cached_property
    def _period(self) -> Floats:
        """(n,) period of each dimension, 0 where it does not wrap."""
        return np.where(self.periodic, self.bounds.widths, 0.0)

    @cached_property
    def _wraps(self) -> bool:
        """Whether any dimension does."""
        return bool(np.any(self.periodic))

    def as_states(self, states: ArrayLike) -> Floats:
        """The same states (..., n), as an array.

        Raises:
            ValueError: their last axis has not n entries.
        """
        array = np.asarray(states, dtype=float)
        if array.shape[-1:] != (self.dimension,):
            raise ValueError(
                f"states of {', '.join(self.names)} have a last axis of {self.dimension}, not an "
                f"array of shape {array.shape}"
            )
        return array

    def wrap(self, states: ArrayLike) -> Floats:
        """states (..., n) with periodic dimensions brought into [lower, upper)."""
        states = self.as_states(states)
        if not self._wraps:
            return states
        turns = np.floor((states - self.bounds.lower) / self.bounds.widths)
        wrapped = states - turns * self._period
        # Rounding can leave a state at the seam a hair outside: the seam is `lower`.
        outside = (wrapped < self.bounds.lower) | (wrapped >= self.bounds.upper)
        return np.where(self.periodic & outside, self.bounds.lower, wrapped)

    def difference(self, to: ArrayLike, origin: ArrayLike) -> Floats:
        """to - origin (..., n), the short way round: in (-period / 2, period / 2]."""
        step = np.asarray(to, dtype=float) - np.asarray(origin, dtype=float)
        if not self._wraps:
            return step
        return step - np.ceil(step / self.bounds.widths - 0.5) * self._period

    def unwrap(self, path: ArrayLike) -> Floats:
        """A path (..., K+1, n) without jumps: each sample the short way from the one before."""
        path = self.as_states(path)
        steps = path[..., 1:, :] - path[..., :-1, :]
        turns = np.ceil(steps / self.bounds.widths - 0.5) * self._period
        turns = np.concatenate([np.zeros_like(path[..., :1, :]), turns], axis=-2)
        return path - np.cumsum(turns, axis=-2)

    def contains(self, states: ArrayLike) -> Bools:
        """Whether states (..., n) lie in the bounds; periodic dimensions take any finite value."""
        states = self.as_states(states)
        inside: Bools = np.asarray(True)
        # One dimension after the other: numpy is slow along so short an axis.
        for d, (lower, upper) in enumerate(zip(self.bounds.lower, self.bounds.upper, strict=True)):
            along = states[..., d]
            if self.periodic[d]:
                inside = inside & np.isfinite(along)
            else:
                inside = inside & (along >= lower) & (along <= upper)
        return inside

    def excess(self, states: ArrayLike, region: Box) -> Floats:
        """How far each dimension of states (..., n) is outside `region`: signed, 0 inside.

        It is the short way round in periodic dimensions, so for a region that is one point it
        is `difference(states, point)`.
        """
        states = np.asarray(states, dtype=float)
        middle, half = middle_and_half(region)
        offset = np.where(np.isfinite(half), self.difference(states, middle), 0.0)
        return np.sign(offset) * np.maximum(np.abs(offset) - half, 0.0)

    def signed_distance(self, states: ArrayLike, region: Box) -> Floats:
        """dist_K: distance (...,) of states (..., n) to a box, negative inside (section V-B).

        Euclidean in the raw units of the state, the short way round in periodic dimensions. A
        free (infinite) dimension of the region, and a periodic one that it covers, do not count.
        """
        states = self.as_states(states)
        middle, half = middle_and_half(region)
        counts = np.isfinite(half) & ~(self.periodic & (2 * half >= self.bounds.widths))
        if not np.any(counts):
            return np.full(states.shape[:-1], -np.inf)
        beyond = np.abs(self.difference(states, middle))[..., counts] - half[counts]
        outside = np.sqrt(np.sum(np.maximum(beyond, 0.0) ** 2, axis=-1))
        return outside + np.minimum(np.max(beyond, axis=-1), 0.0)


def middle_and_half(region: Box) -> tuple[Floats, Floats]:
    """Centre (n,) and half widths (n,) of a region; 0 and inf where it is unbounded.

    Raises:
        ValueError: a side that is bounded at one end alone.
    """
    bounded = np.isfinite(region.lower) & np.isfinite(region.upper)
    half_free = ~bounded & (np.isfinite(region.lower) | np.isfinite(region.upper))
    if np.any(half_free):
        raise ValueError(f"a region's side is bounded at both ends or at neither: {region}")
    lower, upper = np.where(bounded, region.lower, 0.0), np.where(bounded, region.upper, 0.0)
    return (lower + upper) / 2, np.where(bounded, (upper - lower) / 2, np.inf)
