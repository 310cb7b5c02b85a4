"""Named regions of the state space: constraint hypotheses and the ground truth alike.

A path violates a region when it meets the region's interior: to touch an edge is not to enter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # loads scipy.sparse when it is first used
from numpy.typing import ArrayLike

from mlci.grids import Grid
from mlci.shapes.box_relations import boxes_inside, boxes_overlap, check_corners
from mlci.shapes.chords import Boxes
from mlci.shapes.images import images
from mlci.shapes.membership import covered_by_points, shared_by_points
from mlci.shapes.shape import Cuboid, Shape, as_shape, checked_hull
from mlci.spaces import Bools, Box, Floats, Ints, StateSpace

BoxRelation = Callable[["Regions", "Regions"], Bools]
ShapeRelation = Callable[[StateSpace, Shape, Shape], bool]


@dataclass(frozen=True, eq=False)
class Regions:
    """C regions of a state space; they may overlap, need not cover it, and there may be none.

    Attributes:
        space: the state space.
        lower: (C, n) lower corners of the regions, or of their hulls where they are no boxes; -inf
            where a dimension is free.
        upper: (C, n) upper corners, +inf where a dimension is free.
        names: (C,) name of each region, all different; by default its number, from "0".
        shapes: (C,) what each region is; None for the box between its corners.

    Raises:
        ValueError: corners of the wrong shape, an empty box, a side with one infinite end, or names
            or shapes that are too few, too many or not different.
    """

    space: StateSpace
    lower: Floats
    upper: Floats
    names: tuple[str, ...] = ()
    shapes: tuple[Shape | None, ...] = ()

    def __post_init__(self) -> None:
        lower, upper = np.array(self.lower, dtype=float), np.array(self.upper, dtype=float)
        check_corners(self.space, lower, upper)
        names = tuple(self.names) or _numbers(len(lower))
        if len(names) != len(lower) or len(set(names)) < len(names):
            raise ValueError(f"{len(lower)} regions need as many different names, not {names}")
        shapes = tuple(self.shapes) or (None,) * len(lower)
        if len(shapes) != len(lower):
            raise ValueError(f"{len(lower)} regions need as many shapes, not {len(shapes)}")
        object.__setattr__(self, "shapes", shapes)
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        object.__setattr__(self, "names", names)

    def __len__(self) -> int:
        return len(self.lower)

    @classmethod
    def from_boxes(
        cls, space: StateSpace, boxes: Iterable[Box], names: Sequence[str] = ()
    ) -> Regions:
        """The regions listed, in their order."""
        corners = np.array([(box.lower, box.upper) for box in boxes])
        lower, upper = np.moveaxis(corners.reshape(-1, 2, space.dimension), 1, 0)
        return cls(space, lower, upper, tuple(names))

    @classmethod
    def from_shapes(
        cls, space: StateSpace, shapes: Iterable[Shape | Box], names: Sequence[str] = ()
    ) -> Regions:
        """The regions listed, boxes or other shapes, in their order.

        Raises:
            ValueError: a shape that cannot be one of this space, or lies outside its bounds.
        """
        if isinstance(shapes, Shape | Box):
            raise ValueError(f"regions are a list of shapes, not one {type(shapes).__name__}")
        parts = [as_shape(shape) for shape in shapes]
        hulls = [checked_hull(space, part, f"region {k}") for k, part in enumerate(parts)]
        corners = np.array([(hull.lower, hull.upper) for hull in hulls])
        lower, upper = np.moveaxis(corners.reshape(-1, 2, space.dimension), 1, 0)
        kinds = tuple(None if isinstance(part, Cuboid) else part for part in parts)
        return cls(space, lower, upper, tuple(names), kinds)

    @classmethod
    def from_grid(cls, space: StateSpace, shape: Sequence[int | None]) -> Regions:
        """Equal cells over any subset of the dimensions: a None in `shape` leaves one free."""
        grid = Grid(space, tuple(1 if count is None else count for count in shape))
        lower, upper = grid.corners
        free = np.array([count is None for count in shape])
        return cls(space, np.where(free, -np.inf, lower), np.where(free, np.inf, upper))

    def box(self, index: int) -> Box:
        """Region `index` as a box; its hull if it is none."""
        return Box(self.lower[index], self.upper[index])

    def shape(self, index: int) -> Shape:
        """Region `index` as a shape."""
        return self.shapes[index] or Cuboid(self.box(index))

    @cached_property
    def are_boxes(self) -> Bools:
        """(C,) which regions are boxes."""
        return np.array([shape is None for shape in self.shapes], dtype=bool)

    def joined(self, other: Regions) -> Regions:
        """These regions, then the other's.

        Numbers go on where both sets are numbered; other names may not be in both.
        """
        numbered = all(regions.names == _numbers(len(regions)) for regions in (self, other))
        return Regions(
            self.space,
            np.concatenate([self.lower, other.lower]),
            np.concatenate([self.upper, other.upper]),
            () if numbered else self.names + other.names,
            self.shapes + other.shapes,
        )

    def mask(self, names: Iterable[str]) -> Bools:
        """(C,) which regions have one of these names.

        Raises:
            ValueError: a name that no region has.
        """
        asked = set(names)
        if unknown := sorted(asked - set(self.names)):
            raise ValueError(f"no region is named {', '.join(unknown)}")
        return np.array([name in asked for name in self.names], dtype=bool)

    def select(self, mask: ArrayLike) -> Regions:
        """The regions where mask (C,) is true, in their order."""
        chosen = as_mask(mask, len(self))
        names = tuple(name for name, is_in in zip(self.names, chosen, strict=True) if is_in)
        shapes = tuple(each for each, is_in in zip(self.shapes, chosen, strict=True) if is_in)
        return Regions(self.space, self.lower[chosen], self.upper[chosen], names, shapes)

    def signed_distance(self, states: ArrayLike) -> Floats:
        """dist_K of the union (...,) at states (..., n): below 0 inside some region.

        +inf everywhere if there is no region. Of a region that is no box it is the level of
        `mlci.shapes.shape`: of the same sign, and no more than the distance.

        Raises:
            ValueError: a region that knows no distance, such as a predicate without a steepness.
        """
        states = self.space.as_states(states)
        nowhere = np.full(states.shape[:-1], np.inf)
        for name, shape in zip(self.names, self.shapes, strict=True):
            if shape is not None and not shape.has_distance:
                raise ValueError(
                    f"region {name} knows what is inside, but not how far away it is, which a safe "
                    "set needs: give its `steepness`"
                )
        each = [self.shape(i).level(self.space, states) for i in range(len(self))]
        return np.min([nowhere, *each], axis=0)

    def inside(self, other: Regions) -> Bools:
        """(C,) which regions lie entirely in one region of `other` (to 1e-9 of the bounds).

        What a region holds beyond the bounds of the state space does not count, and one that holds
        nothing else is inside nothing. Where one of two is no box, points of the region tell, see
        `membership`.
        """
        if not (self.are_boxes.all() and other.are_boxes.all()):
            return self._by_points(other, Regions.inside, covered_by_points)
        return boxes_inside(self.space, self._corners, other._corners)

    def overlaps(self, other: Regions) -> Bools:
        """(C,) which regions share more than an edge with some region of `other`.

        What is shared must be wider than 1e-9 of the bounds in each dimension. Where one of two is
        no box, points of both tell, see `membership`.
        """
        if not (self.are_boxes.all() and other.are_boxes.all()):
            return self._by_points(other, Regions.overlaps, shared_by_points)
        return boxes_overlap(self.space, self._corners, other._corners)

    def _by_points(self, other: Regions, of_boxes: BoxRelation, of_shapes: ShapeRelation) -> Bools:
        """(C,) which regions are so related to some region of `other`: boxes by their corners."""
        mine, theirs = self.are_boxes, other.are_boxes
        related = np.zeros(len(self), dtype=bool)
        related[mine] = of_boxes(self.select(mine), other.select(theirs))
        for i in np.flatnonzero(~related).tolist():
            related[i] = any(
                of_shapes(self.space, self.shape(i), other.shape(j))
                for j in range(len(other))
                if not (mine[i] and theirs[j])
            )
        return related

    @property
    def _corners(self) -> tuple[Floats, Floats]:
        """The corners (C, n)."""
        return self.lower, self.upper

    def violated_by(self, paths: ArrayLike) -> Bools:
        """D: which regions (..., C) a path (..., K+1, n) enters, tested on its whole polyline.

        Consecutive samples are joined by a straight line, the short way round in periodic
        dimensions, so the path need not be unwrapped. A path of one sample is a point.
        """
        paths = self.space.as_states(paths)
        batch = paths.shape[:-2]
        if paths.shape[-2] == 1:
            paths = np.repeat(paths, 2, axis=-2)
        flat = paths.reshape(-1, *paths.shape[-2:])
        hits = self.crossings(flat[:, :-1], self.space.difference(flat[:, 1:], flat[:, :-1]))
        return np.asarray(hits.toarray()).reshape(*batch, len(self))

    def crossings(
        self, starts: Floats, steps: Floats, tested: Bools | None = None
    ) -> scipy.sparse.csr_matrix:
        """Which regions paths of straight chords cross.

        Args:
            starts: (P, K, n) first ends of the chords of P paths.
            steps: (P, K, n) displacements; below half a period in periodic dimensions.
            tested: (P,) which paths count, the others cross nothing; None for all.

        Returns:
            (P, C) sparse boolean matrix.
        """
        tested = np.ones(len(starts), dtype=bool) if tested is None else tested
        starts = self.space.wrap(starts)
        begins, region, *_ = self._boxes.hits(starts, steps, tested)
        entered = np.ones(len(region), dtype=bool)
        hits = scipy.sparse.csr_matrix((entered, region, begins), shape=(len(starts), len(self)))
        if self.are_boxes.all():
            return hits
        paths, (chords, n) = np.flatnonzero(tested), starts.shape[1:]
        ends = starts[paths].reshape(-1, n), steps[paths].reshape(-1, n)
        rows, columns = [], []
        for i in np.flatnonzero(~self.are_boxes).tolist():
            met = np.unique(self.shape(i).spans(self.space, *ends).chord // chords)
            rows.append(paths[met])
            columns.append(np.full(len(met), i))
        row, column = np.concatenate(rows), np.concatenate(columns)
        met = scipy.sparse.csr_matrix((np.ones(len(row), bool), (row, column)), shape=hits.shape)
        return scipy.sparse.csr_matrix(hits + met)

    def chord_hits(self, starts: Floats, steps: Floats) -> tuple[Ints, Ints, Floats, Floats]:
        """Pairs (chord, image) that meet, and shares of the chord between; starts wrapped.

        Of boxes alone.
        """
        region, lower, upper = self.images
        each = Boxes.of(lower, upper, np.arange(len(region)))
        begins, image, enter, leave = each.hits(
            starts[:, None], steps[:, None], np.ones(len(starts), dtype=bool)
        )
        return np.repeat(np.arange(len(starts)), np.diff(begins)), image, enter, leave

    @cached_property
    def _boxes(self) -> Boxes:
        """The images, for `crossings`: those of one region count once."""
        region, lower, upper = self.images
        return Boxes.of(lower, upper, region)

    @cached_property
    def images(self) -> tuple[Ints, Floats, Floats]:
        """The copies of boxes, whole periods apart, that a wrapped chord can reach.

        Returns their region numbers (I,) and corners (I, n).
        """
        boxes = np.flatnonzero(self.are_boxes)
        copy, lower, upper = images(self.space, self.lower[boxes], self.upper[boxes])
        return boxes[copy], lower, upper


def _numbers(count: int) -> tuple[str, ...]:
    """The names of regions that are given none."""
    return tuple(map(str, range(count)))


def as_mask(mask: ArrayLike | None, count: int) -> Bools:
    """A mask over regions (count,), checked; of all of them for None.

    Raises:
        ValueError: it has another shape, or holds anything but truth values.
    """
    checked = np.ones(count, dtype=bool) if mask is None else np.asarray(mask)
    if checked.dtype != bool or checked.shape != (count,):
        raise ValueError(
            f"a mask over {count} regions needs as many truth values, not {checked.dtype} of shape "
            f"{checked.shape}; Regions.mask makes one from names"
        )
    return checked
