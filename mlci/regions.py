"""Named regions of the state space: constraint hypotheses and the ground truth alike.

A path violates a region when it meets the region's interior: to touch an edge is not to enter.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # loads scipy.sparse when it is first used
from numpy.typing import ArrayLike

from mlci.chords import Boxes
from mlci.grids import Grid
from mlci.spaces import Bools, Box, Floats, Ints, StateSpace


@dataclass(frozen=True, eq=False)
class Regions:
    """C boxes in a state space; they may overlap, need not cover it, and there may be none.

    Attributes:
        space: the state space.
        lower: (C, n) lower corners, -inf where a dimension is free.
        upper: (C, n) upper corners, +inf where a dimension is free.
        names: (C,) name of each region, all different; by default its number, from "0".

    Raises:
        ValueError: corners of the wrong shape, an empty box, a side with one infinite end, or names
            that are too few, too many or not different.
    """

    space: StateSpace
    lower: Floats
    upper: Floats
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        lower, upper = np.array(self.lower, dtype=float), np.array(self.upper, dtype=float)
        n = self.space.dimension
        if lower.ndim != 2 or lower.shape != upper.shape or lower.shape[1] != n:
            raise ValueError(
                f"regions need corners of shape (C, {n}), not {lower.shape} and {upper.shape}"
            )
        bad = ~np.all((lower < upper) & (np.isfinite(lower) == np.isfinite(upper)), axis=1)
        if bad.any():
            first = int(np.argmax(bad))
            raise ValueError(
                f"region {first} needs lower < upper and both ends finite or neither: "
                f"{lower[first].tolist()} to {upper[first].tolist()}"
            )
        names = tuple(self.names) or _numbers(len(lower))
        if len(names) != len(lower) or len(set(names)) < len(names):
            raise ValueError(f"{len(lower)} regions need as many different names, not {names}")
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
    def from_grid(cls, space: StateSpace, shape: Sequence[int | None]) -> Regions:
        """Equal cells over any subset of the dimensions: a None in `shape` leaves one free."""
        grid = Grid(space, tuple(1 if count is None else count for count in shape))
        lower, upper = grid.corners
        free = np.array([count is None for count in shape])
        return cls(space, np.where(free, -np.inf, lower), np.where(free, np.inf, upper))

    def box(self, index: int) -> Box:
        """Region `index` as a box."""
        return Box(self.lower[index], self.upper[index])

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
        return Regions(self.space, self.lower[chosen], self.upper[chosen], names)

    def signed_distance(self, states: ArrayLike) -> Floats:
        """dist_K of the union (...,) at states (..., n): below 0 inside some region.

        +inf everywhere if there is no region.
        """
        nowhere = np.full(np.shape(states)[:-1], np.inf)
        each = [self.space.signed_distance(states, self.box(i)) for i in range(len(self))]
        return np.min([nowhere, *each], axis=0)

    def inside(self, other: Regions) -> Bools:
        """(C,) which regions lie entirely in one region of `other` (to 1e-9 of the bounds).

        What a region holds beyond the bounds of the state space does not count, and one that holds
        nothing else is inside nothing.
        """
        widths, periodic = self.space.bounds.widths, self.space.periodic
        slack = 1e-9 * widths
        mine, theirs = self._within_bounds(), other._within_bounds()
        covered = np.zeros(len(self), dtype=bool)
        for lower, upper in zip(*theirs, strict=True):
            ahead = mine[0] - lower
            ahead -= np.where(periodic, np.floor((ahead + slack) / widths) * widths, 0.0)
            fits = (ahead >= -slack) & (ahead + mine[1] - mine[0] <= upper - lower + slack)
            all_round = periodic & (upper - lower >= widths - slack)
            covered |= np.all(fits | all_round, axis=1)
        return covered & np.all(mine[1] - mine[0] > slack, axis=1)

    def overlaps(self, other: Regions) -> Bools:
        """(C,) which regions share more than an edge with some region of `other`.

        What is shared must be wider than 1e-9 of the bounds in each dimension.
        """
        widths, periodic = self.space.bounds.widths, self.space.periodic
        slack = 1e-9 * widths
        mine, theirs = self._within_bounds(), other._within_bounds()
        shared = np.zeros(len(self), dtype=bool)
        for lower, upper in zip(*theirs, strict=True):
            # Two intervals overlap where one of them begins inside the other.
            ahead, behind = lower - mine[0], mine[0] - lower
            ahead -= np.where(periodic, np.floor((ahead + slack) / widths) * widths, 0.0)
            behind -= np.where(periodic, np.floor((behind + slack) / widths) * widths, 0.0)
            begins_in_mine = (ahead > -slack) & (ahead < mine[1] - mine[0] - slack)
            begins_in_theirs = (behind > -slack) & (behind < upper - lower - slack)
            if np.all(upper - lower > slack):
                shared |= np.all(begins_in_mine | begins_in_theirs, axis=1)
        return shared & np.all(mine[1] - mine[0] > slack, axis=1)

    def _within_bounds(self) -> tuple[Floats, Floats]:
        """Finite corners (C, n): cut to the bounds, and to one period where a region goes round."""
        bounds, periodic = self.space.bounds, self.space.periodic
        lower = np.where(periodic, self.lower, np.maximum(self.lower, bounds.lower))
        upper = np.where(periodic, self.upper, np.minimum(self.upper, bounds.upper))
        all_round = periodic & (upper - lower >= bounds.widths)
        return np.where(all_round, bounds.lower, lower), np.where(all_round, bounds.upper, upper)

    def violated_by(self, paths: ArrayLike) -> Bools:
        """D: which regions (..., C) a path (..., K+1, n) enters, tested on its whole polyline.

        Consecutive samples are joined by a straight line, the short way round in periodic
        dimensions, so the path need not be unwrapped. A path of one sample is a point.
        """
        paths = np.asarray(paths, dtype=float)
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
        begins, region, *_ = self._boxes.hits(self.space.wrap(starts), steps, tested)
        entered = np.ones(len(region), dtype=bool)
        return scipy.sparse.csr_matrix((entered, region, begins), shape=(len(starts), len(self)))

    def chord_hits(self, starts: Floats, steps: Floats) -> tuple[Ints, Ints, Floats, Floats]:
        """Pairs (chord, image) that meet, and shares of the chord between; starts wrapped."""
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
        """The regions' copies, whole periods apart, that a wrapped chord can reach.

        Returns their region numbers (I,) and corners (I, n).
        """
        region, lower, upper = np.arange(len(self)), self.lower.copy(), self.upper.copy()
        for d in np.flatnonzero(self.space.periodic):
            period = self.space.bounds.widths[d]
            free = upper[:, d] - lower[:, d] >= period
            lower[free, d], upper[free, d] = -np.inf, np.inf
            # Chords start in the bounds and are at most half a period long.
            chords_from = self.space.bounds.lower[d] - period / 2
            chords_to = self.space.bounds.upper[d] + period / 2
            first = np.where(free, 0.0, np.ceil((chords_from - upper[:, d]) / period))
            last = np.where(free, 0.0, np.floor((chords_to - lower[:, d]) / period))
            copies = [(region[:0], lower[:0], upper[:0])]
            for turns in np.arange(first.min(initial=0.0), last.max(initial=0.0) + 1):
                wanted = (first <= turns) & (turns <= last)
                shift = np.where(np.arange(self.space.dimension) == d, turns * period, 0.0)
                copies.append((region[wanted], lower[wanted] + shift, upper[wanted] + shift))
            region, lower, upper = map(np.concatenate, zip(*copies, strict=True))
        return region, lower, upper


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
