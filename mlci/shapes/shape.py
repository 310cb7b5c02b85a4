"""What a region can be: boxes and other shapes, and what is made of them.

A shape knows two things. Its *level* at a state is below 0 inside and above 0 outside; between two
states it changes by no more than their Euclidean distance in the raw units of the state, so that it
never says more than the distance to the border, as dist_K of section V-B does. Its *spans* are the
parts of straight chords that lie inside. `a | b` is a union (the lesser level), `a & b` an
intersection (the greater), `~a` a complement (minus the level).

Balls, half-spaces and predicates are in modules of their own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from mlci.shapes.chords import Boxes
from mlci.shapes.images import images
from mlci.shapes.spans import Spans
from mlci.spaces import Box, Floats, Ints, StateSpace


class Shape(ABC):
    """A set of states; what its interior holds is in the region."""

    @property
    def has_distance(self) -> bool:
        """Whether the level is bounded by the distance; otherwise its sign alone counts."""
        return True

    @abstractmethod
    def check(self, space: StateSpace) -> None:
        """Raise a ValueError if the shape cannot be one of this state space."""

    @abstractmethod
    def level(self, space: StateSpace, states: Floats) -> Floats:
        """Level (...,) at states (..., n), the short way round in periodic dimensions."""

    @abstractmethod
    def spans(self, space: StateSpace, starts: Floats, steps: Floats) -> Spans:
        """What lies inside of chords from wrapped starts (P, n) by steps (P, n)."""

    @abstractmethod
    def hull(self, space: StateSpace) -> Box:
        """A box that holds what of the shape lies in the bounds; infinite where it is free."""

    def __or__(self, other: Shape | Box) -> Shape:
        return Union((self, other))

    def __ror__(self, other: Box) -> Shape:
        return Union((other, self))

    def __and__(self, other: Shape | Box) -> Shape:
        return Intersection((self, other))

    def __rand__(self, other: Box) -> Shape:
        return Intersection((other, self))

    def __invert__(self) -> Shape:
        return Complement(self)


@dataclass(frozen=True, eq=False)
class Cuboid(Shape):
    """A box as a part of other shapes.

    Attributes:
        box: the box; infinite at both ends of a free dimension.
    """

    box: Box

    def check(self, space: StateSpace) -> None:
        """See `Shape.check`."""
        box = self.box
        if box.dimension != space.dimension:
            raise ValueError(f"a box in {space.dimension} dimensions, not {box.dimension}: {box}")
        bounded = np.isfinite(box.lower)
        if not np.all((box.lower < box.upper) & (bounded == np.isfinite(box.upper))):
            raise ValueError(f"a box needs lower < upper and both ends finite or neither: {box}")

    def level(self, space: StateSpace, states: Floats) -> Floats:
        """The signed distance."""
        return space.signed_distance(states, self.box)

    def spans(self, space: StateSpace, starts: Floats, steps: Floats) -> Spans:
        """See `Shape.spans`; exact."""
        _, lower, upper = images(space, self.box.lower[None], self.box.upper[None])
        boxes, tested = Boxes.of(lower, upper, np.arange(len(lower))), np.ones(len(starts), bool)
        begins, _, enter, leave = boxes.hits(starts[:, None], steps[:, None], tested)
        return Spans.of(len(starts), _owners(begins), enter, leave)

    def hull(self, space: StateSpace) -> Box:
        """The box."""
        return self.box


@dataclass(frozen=True, eq=False)
class Union(Shape):
    """States in at least one of several shapes, at least one.

    Attributes:
        parts: the shapes.
    """

    parts: tuple[Shape, ...]

    def __init__(self, parts: tuple[Shape | Box, ...]) -> None:
        if not parts:
            raise ValueError("a union or an intersection needs at least one shape")
        object.__setattr__(self, "parts", tuple(as_shape(part) for part in parts))

    @property
    def has_distance(self) -> bool:
        """See `Shape.has_distance`."""
        return all(part.has_distance for part in self.parts)

    def check(self, space: StateSpace) -> None:
        """See `Shape.check`."""
        for part in self.parts:
            part.check(space)

    def level(self, space: StateSpace, states: Floats) -> Floats:
        """The least level."""
        return np.asarray(np.min([part.level(space, states) for part in self.parts], axis=0))

    def spans(self, space: StateSpace, starts: Floats, steps: Floats) -> Spans:
        """See `Shape.spans`."""
        return Spans.joined([part.spans(space, starts, steps) for part in self.parts])

    def hull(self, space: StateSpace) -> Box:
        """The smallest box that holds the parts' hulls."""
        hulls = [part.hull(space) for part in self.parts]
        lower = np.min([hull.lower for hull in hulls], axis=0)
        return Box(lower, np.max([hull.upper for hull in hulls], axis=0))


@dataclass(frozen=True, eq=False)
class Complement(Shape):
    """States that are not in a shape.

    Attributes:
        part: the shape.
    """

    part: Shape

    def __init__(self, part: Shape | Box) -> None:
        object.__setattr__(self, "part", as_shape(part))

    @property
    def has_distance(self) -> bool:
        """See `Shape.has_distance`."""
        return self.part.has_distance

    def check(self, space: StateSpace) -> None:
        """See `Shape.check`."""
        self.part.check(space)

    def level(self, space: StateSpace, states: Floats) -> Floats:
        """Minus the level."""
        return -self.part.level(space, states)

    def spans(self, space: StateSpace, starts: Floats, steps: Floats) -> Spans:
        """See `Shape.spans`."""
        return self.part.spans(space, starts, steps).complement()

    def hull(self, space: StateSpace) -> Box:
        """The bounds, in the dimensions that the shape is bounded in."""
        counts = np.isfinite(self.part.hull(space).lower)
        lower = np.where(counts, space.bounds.lower, -np.inf)
        return Box(lower, np.where(counts, space.bounds.upper, np.inf))


class Intersection(Union):
    """States in all of several shapes, at least one."""

    def level(self, space: StateSpace, states: Floats) -> Floats:
        """The greatest level."""
        return np.asarray(np.max([part.level(space, states) for part in self.parts], axis=0))

    def spans(self, space: StateSpace, starts: Floats, steps: Floats) -> Spans:
        """See `Shape.spans`: what is in no part's complement."""
        parts = [part.spans(space, starts, steps).complement() for part in self.parts]
        return Spans.joined(parts).complement()

    def hull(self, space: StateSpace) -> Box:
        """The part of the bounds in the first part's hull that others leave of it."""
        hulls = [part.hull(space) for part in self.parts]
        wraps = space.periodic  # two arcs may meet twice: the narrower of them holds what they do
        narrow = [np.argmin([hull.widths[d] for hull in hulls]) for d in range(space.dimension)]
        lower = np.max([hull.lower for hull in hulls], axis=0)
        upper = np.min([hull.upper for hull in hulls], axis=0)
        for d in range(space.dimension):
            if wraps[d] or not lower[d] < upper[d]:
                lower[d], upper[d] = hulls[narrow[d]].lower[d], hulls[narrow[d]].upper[d]
        return Box(lower, upper)


def as_shape(part: Shape | Box) -> Shape:
    """A box as a shape; shapes as they are.

    Raises:
        ValueError: neither.
    """
    if not isinstance(part, Shape | Box):
        raise ValueError(
            f"a region is a Box, or a shape such as a Ball or a Predicate, not {part!r:.80}"
        )
    return Cuboid(part) if isinstance(part, Box) else part


def checked_hull(space: StateSpace, part: Shape, name: str) -> Box:
    """The hull of a shape that can be one of a state space.

    Raises:
        ValueError: a shape that cannot, or has nothing in the bounds; the message begins with the
            name.
    """
    try:
        part.check(space)
        hull = part.hull(space)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    except Exception as error:  # it may be anybody's function
        raise ValueError(f"{name} fails: {type(error).__name__}: {error}") from error
    bounds, ends = space.bounds, ~space.periodic
    meets = (hull.lower < bounds.upper) & (hull.upper > bounds.lower)
    if not np.all(hull.lower < hull.upper) or not np.all(meets[ends]):
        raise ValueError(f"{name} holds nothing of the bounds of the state space")
    return hull


def _owners(begins: Ints) -> Ints:
    """Of which of some lists, which begin at (P+1,), each of their entries is."""
    return np.repeat(np.arange(len(begins) - 1), np.diff(begins))
