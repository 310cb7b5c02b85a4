"""Regions that no formula describes: predicates of states, and shapes in a task space.

Where a chord crosses their border is searched for: the level is looked at in places that are at
most 1/512 of the bounds apart in each dimension, and between two of different signs the border is
found by bisection to 2^-40 of their distance. A visit shorter than that between two places may be
missed. Functions are given wrapped states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.shapes.shape import Shape, as_shape
from mlci.shapes.spans import Spans
from mlci.spaces import Bools, Box, Floats, Ints, StateSpace

_PLACES = 512  # across the bounds
_BISECTIONS = 40
_AT_ONCE = 1 << 18  # states that a function is given
_RANDOM = 4096  # states that a function is tried at

StateFunction = Callable[[Floats], ArrayLike]


class _Searched(Shape):
    """A shape that its level alone describes."""

    def spans(self, space: StateSpace, starts: Floats, steps: Floats) -> Spans:
        """See `Shape.spans` and the module's head."""
        length, ends = np.linalg.norm(steps, axis=1), starts + steps
        known = np.all(np.isfinite(ends), axis=1)
        parts = [Spans.whole(len(starts), np.zeros(len(starts), dtype=bool))]
        if self.has_distance and known.any():  # most chords are far from the border
            level = np.full(len(starts), np.inf)
            level[known] = self.level(space, (starts + ends)[known] / 2)
            parts.append(Spans.whole(len(starts), (level < 0) & (level <= -length / 2)))
            known &= np.abs(level) < length / 2
        widest = np.max(np.abs(steps) / space.bounds.widths, axis=1)
        pieces = np.maximum(np.ceil(np.where(known, widest, 0.0) * _PLACES), 1).astype(np.int64)
        blocks = np.cumsum(pieces + 1)[known] // _AT_ONCE
        for block in np.split(np.flatnonzero(known), np.flatnonzero(np.diff(blocks)) + 1):
            if len(block):
                found = self._search(space, starts[block], steps[block], pieces[block])
                parts.append(Spans.of(len(starts), block[found.chord], found.enter, found.leave))
        return Spans.joined(parts)

    def _search(self, space: StateSpace, starts: Floats, steps: Floats, pieces: Ints) -> Spans:
        """The spans of chords that are looked at in places between so many pieces (P,) each."""

        def inside(chord: Ints, share: Floats) -> Bools:
            states = starts[chord] + share[:, None] * steps[chord]
            return np.asarray(self.level(space, states) < 0)

        places = pieces + 1
        chord = np.repeat(np.arange(len(starts)), places)
        place = np.arange(len(chord)) - np.repeat(np.cumsum(places) - places, places)
        share = place / pieces[chord]
        within = inside(chord, share)
        # Of each two places with different signs, the one outside and the one inside.
        change = np.flatnonzero((within[1:] != within[:-1]) & (chord[1:] == chord[:-1]))
        outside, inner = change + within[change], change + ~within[change]
        low, high = share[outside], share[inner]
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            is_in = inside(chord[change], middle)
            low, high = np.where(is_in, low, middle), np.where(is_in, middle, high)
        first, last = place == 0, place == pieces[chord]
        enter, leave = np.where(first, 0.0, np.nan), np.where(last, 1.0, np.nan)
        enters, leaves = inner > outside, inner < outside
        enter[inner[enters]], leave[inner[leaves]] = low[enters], low[leaves]
        begins = np.flatnonzero(within & ~np.isnan(enter))
        return Spans.of(len(starts), chord[begins], enter[begins], leave[within & ~np.isnan(leave)])

    def hull(self, space: StateSpace) -> Box:
        """The bounds: a function does not say where it ends."""
        return space.bounds


@dataclass(frozen=True, eq=False)
class Predicate(_Searched):
    """States for which a function says yes.

    Attributes:
        function: of states (..., n); returns truth values (...,), or levels, which are below 0
            where the region is.
        steepness: for levels, the most that they change per distance between states, Euclidean in
            raw units; None if that is not known. A safe set needs it.

    Raises:
        ValueError: no function, or a steepness that is not positive.
    """

    function: StateFunction
    steepness: float | None = None

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise ValueError(f"a predicate needs a function of states, not {self.function!r}")
        _check_steepness(self.steepness)

    @property
    def has_distance(self) -> bool:
        """See `Shape.has_distance`."""
        return self.steepness is not None

    def check(self, space: StateSpace) -> None:
        """See `Shape.check`: shapes and numbers that the function returns, at random states."""
        states = _random_states(space)
        values = np.asarray(self.function(states))
        if values.shape != states.shape[:-1] or values.dtype.kind not in "bif":
            raise ValueError(
                f"{_name(self.function)} must return a truth value or a level a state, of shape "
                f"{states.shape[:-1]} for states {states.shape}; it returned {values.dtype} of "
                f"shape {values.shape}"
            )
        if np.isnan(values).any():
            raise ValueError(f"{_name(self.function)} returned NaN for states within the bounds")
        if self.steepness is not None and values.dtype.kind == "b":
            raise ValueError(
                f"{_name(self.function)} returns truth values, which have no steepness: return "
                "levels, or leave it out"
            )
        _check_levels(self, space, states, _name(self.function))

    def level(self, space: StateSpace, states: Floats) -> Floats:
        """The function's level by its steepness; -1 and 1 for truth values."""
        values = np.asarray(self.function(space.wrap(states)))
        if values.dtype.kind == "b":
            return np.where(values, -1.0, 1.0)
        return np.asarray(values / (self.steepness or 1.0), dtype=float)


@dataclass(frozen=True, eq=False)
class InTaskSpace(_Searched):
    """States whose image y = f(state) lies in a shape, such as those with a hand in a box.

    Attributes:
        task: f, from states (..., n) to points (..., k).
        shape: the shape in the task space, whose dimensions do not wrap.
        steepness: the most that f changes per distance between states, Euclidean in raw units: the
            greatest singular value of its Jacobian. None if it is not known; a safe set needs it.

    Raises:
        ValueError: a steepness that is not positive.
    """

    task: StateFunction
    shape: Shape
    steepness: float | None

    def __init__(
        self, task: StateFunction, shape: Shape | Box, steepness: float | None = None
    ) -> None:
        _check_steepness(steepness)
        object.__setattr__(self, "task", task)
        object.__setattr__(self, "shape", as_shape(shape))
        object.__setattr__(self, "steepness", steepness)

    @property
    def has_distance(self) -> bool:
        """See `Shape.has_distance`."""
        return self.steepness is not None and self.shape.has_distance

    def check(self, space: StateSpace) -> None:
        """See `Shape.check`: the shape of what f returns, at random states."""
        states = _random_states(space)
        points = np.asarray(self.task(states))
        if points.ndim != 2 or len(points) != len(states) or points.dtype.kind not in "if":
            raise ValueError(
                f"{_name(self.task)} must return a point (k,) a state, of shape ({len(states)}, k) "
                f"for states {states.shape}; it returned {points.dtype} of shape {points.shape}"
            )
        if not np.all(np.isfinite(points)):
            raise ValueError(
                f"{_name(self.task)} returned points that are not finite for states in the bounds"
            )
        self.shape.check(_plain_space(points.shape[1]))
        _check_levels(self, space, states, _name(self.task))

    def level(self, space: StateSpace, states: Floats) -> Floats:
        """The shape's level by the steepness of f."""
        points = np.asarray(self.task(space.wrap(states)), dtype=float)
        levels = self.shape.level(_plain_space(points.shape[-1]), points)
        return levels / (self.steepness or 1.0)


def _plain_space(dimension: int) -> StateSpace:
    """A task space: no dimension wraps."""
    one = np.ones(dimension)
    names = tuple(f"y{k}" for k in range(dimension))
    return StateSpace(Box(-one, one), np.zeros(dimension, dtype=bool), names)


def _check_steepness(steepness: float | None) -> None:
    """Raise a ValueError for a steepness that is none."""
    if steepness is not None and not 0 < steepness < np.inf:
        raise ValueError(f"a steepness must be positive, not {steepness}")


def _random_states(space: StateSpace) -> Floats:
    """The states that a function is tried at."""
    rng = np.random.default_rng(0)
    return rng.uniform(space.bounds.lower, space.bounds.upper, (_RANDOM, space.dimension))


def _check_levels(shape: _Searched, space: StateSpace, states: Floats, name: str) -> None:
    """Raise a ValueError if the level rises faster than the steepness says."""
    if not shape.has_distance:
        return
    levels, others = shape.level(space, states), states[::-1]
    far = np.linalg.norm(space.difference(others, states), axis=-1)
    rise = np.abs(levels[::-1] - levels)
    if np.any(rise > far * (1 + 1e-9) + 1e-12):
        steepest = np.max(rise[far > 0] / far[far > 0])
        raise ValueError(
            f"{name} is steeper than its steepness says, {steepest:.4g} times at least: raise it"
        )


def _name(function: StateFunction) -> str:
    """What a message calls a function."""
    return str(getattr(function, "__qualname__", function))
