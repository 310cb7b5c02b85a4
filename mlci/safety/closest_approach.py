"""How close a motion comes to K between two samples: a lower bound of the signed distance.

Between samples the motion stays within step / 4 times the change of its rate of the chord (twice
what a steady acceleration needs), and along a chord the signed distance to a box is convex, so that
its tangents bound it from below.

The boxes of K are arrays (C, n): their centres, and their half widths, which are infinite in a
dimension that the distance does not depend on. A period (n,) is 0 where a dimension does not wrap.

The level of a shape that is no box changes by no more than the length of a chord: half the sum of
the levels at its ends, less half its length, bounds it from below. Chords that matter are cut into
8 parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.compiled import compiled
from mlci.regions import Regions
from mlci.shapes.membership import deepest_level
from mlci.spaces import Bools, Floats, middle_and_half

_PARTS = 8  # of a chord, between whose ends the level of a shape is bounded
_CUTS = 4  # tangents that close in on the least distance along a chord
_TURNED = 1e-9  # of a period that rounding may move an end by


@dataclass(frozen=True, eq=False)
class KeepOut:
    """K: its boxes as the compiled loops take them, and its other shapes; see the module's head."""

    centers: Floats
    halves: Floats
    period: Floats
    others: Regions

    @classmethod
    def of(cls, constraints: Regions) -> KeepOut:
        """K of some regions."""
        space, are_boxes = constraints.space, np.flatnonzero(constraints.are_boxes)
        pairs = [middle_and_half(constraints.box(region)) for region in are_boxes.tolist()]
        centers, halves = np.array(pairs).reshape(-1, 2, space.dimension).transpose(1, 0, 2)
        covered = space.periodic & (2 * halves >= space.bounds.widths)
        return cls(
            np.ascontiguousarray(centers),
            np.where(covered, np.inf, halves),
            np.where(space.periodic, space.bounds.widths, 0.0),
            constraints.select(~constraints.are_boxes),
        )

    @cached_property
    def counted(self) -> Bools:
        """Which dimensions (n,) the signed distance depends on."""
        finite = np.isfinite(np.concatenate([self.halves, self.others.lower]))
        return np.asarray(np.any(finite, axis=0))

    @cached_property
    def depth(self) -> float:
        """How far inside K the signed distance can be."""
        space, numbers = self.others.space, range(len(self.others))
        depths = [-deepest_level(space, self.others.shape(i)) for i in numbers]
        return float(np.max([*np.min(self.halves, axis=1), *depths]))

    def approach(
        self,
        samples: tuple[Floats, Floats],
        rates: tuple[Floats, Floats],
        step: float,
        distance: Floats,
        least: Floats,
    ) -> None:
        """Lower least (B,) to the lower bound of dist_K on the way between two samples.

        Args:
            samples: where the motions are, now and a step later, each (B, n) in Fortran's order.
            rates: their rates there, as well.
            step: time between [s].
            distance: dist_K (B,) at the first sample; becomes that at the second.
            least: the bound so far.
        """
        boxes = self.centers, self.halves, self.period, self.counted
        by_dimension = (each.T for each in (*samples, *rates))
        _approach(*boxes, *by_dimension, step, distance, least)
        if len(self.others):
            ends = [self.others.signed_distance(sample) for sample in samples]
            self._approach_others(samples, rates, step, ends, least)
            distance[:] = np.minimum(distance, ends[1])

    def _approach_others(
        self,
        samples: tuple[Floats, Floats],
        rates: tuple[Floats, Floats],
        step: float,
        ends: Sequence[Floats],
        least: Floats,
    ) -> None:
        """Lower least (B,) by what is no box, whose signed distance (B,) at both samples is `ends`.

        Other arguments are as in `approach`.
        """
        counted = self.counted
        chord = self.others.space.difference(samples[1], samples[0])
        change = np.linalg.norm((rates[1] - rates[0])[:, counted], axis=1)
        bow, length = step / 4 * change, np.linalg.norm(chord[:, counted], axis=1)
        near = np.flatnonzero((ends[0] + ends[1] - length) / 2 - bow < least)
        share = np.linspace(0, 1, _PARTS + 1)[:, None]
        places = samples[0][near, None] + share * chord[near, None]
        level = self.others.signed_distance(places)
        between = (level[:, 1:] + level[:, :-1] - length[near, None] / _PARTS) / 2
        least[near] = np.minimum(least[near], np.min(between, axis=1) - bow[near])


@compiled("UniTuple(f8, 2)(f8[::1], f8[::1], f8[::1])")
def _box_distance(offset: Floats, half: Floats, chord: Floats) -> tuple[float, float]:
    """Signed distance to a box at an offset (n,) from its centre, and its rise by a chord (n,)."""
    squares, deepest, rise, rise_deepest = 0.0, -np.inf, 0.0, 0.0
    for d in range(len(half)):
        if half[d] < np.inf:
            beyond, along = abs(offset[d]) - half[d], np.sign(offset[d]) * chord[d]
            if beyond > deepest:
                deepest, rise_deepest = beyond, along
            if beyond > 0:
                squares += beyond * beyond
                rise += beyond * along
    if squares == 0:
        return deepest, rise_deepest
    away = math.sqrt(squares)
    return away, rise / away


@compiled("f8(f8[::1], f8[::1], f8[::1], f8[::1], f8[::1], f8[::1])")
def _least_on_chord(
    first: Floats, last: Floats, half: Floats, period: Floats, chord: Floats, place: Floats
) -> float:
    """A lower bound of the signed distance to a box along a chord (n,), by cuts.

    Where two tangents meet the next one is taken. First and last (n,) are the offsets of its ends
    from the box's centre, the short way round; place (n,) is room for one between.
    """
    value, slope = _box_distance(first, half, chord)
    end_value, end_slope = _box_distance(last, half, chord)
    turned, square = False, 0.0
    for d in range(len(half)):
        if half[d] < np.inf:
            square += chord[d] * chord[d]
            turned |= abs(first[d] + chord[d] - last[d]) > _TURNED * period[d] > 0
    if turned:  # The short way round changes sides: the distance is not convex, but it is far.
        return (value + end_value - math.sqrt(square)) / 2
    if not (slope < 0 < end_slope):
        return min(value, end_value)
    low, high = 0.0, 1.0
    for cut in range(_CUTS + 1):
        ahead = (end_value - value - end_slope * (high - low)) / (slope - end_slope)
        if cut < _CUTS:
            between = low + ahead
            for d in range(len(half)):
                place[d] = first[d] + between * chord[d]
            found, found_slope = _box_distance(place, half, chord)
            if found_slope < 0:
                low, value, slope = between, found, found_slope
            else:
                high, end_value, end_slope = between, found, found_slope
    return value + slope * ahead


@compiled("void(f8[::1], f8[::1], f8[:, ::1], i8, f8[::1])")
def _offset(center: Floats, period: Floats, states: Floats, b: int, offset: Floats) -> None:
    """The offset (n,) of state b of states (n, B) from a box's centre, the short way round."""
    for d in range(len(period)):
        offset[d] = states[d, b] - center[d]
        if period[d] > 0:
            offset[d] -= math.ceil(offset[d] / period[d] - 0.5) * period[d]


@compiled(
    "void(f8[:, ::1], f8[:, ::1], f8[::1], b1[::1], "
    "f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1], f8, f8[::1], f8[::1])"
)
def _approach(
    centers: Floats,
    halves: Floats,
    period: Floats,
    counted: Bools,
    now: Floats,
    then: Floats,
    rates: Floats,
    rates_then: Floats,
    step: float,
    distance: Floats,
    least: Floats,
) -> None:
    """`KeepOut.approach` of the boxes as loops, over states (n, B)."""
    n = len(period)
    first, last, chord, place = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for b in range(len(least)):
        length, change = 0.0, 0.0
        for d in range(n):
            chord[d] = then[d, b] - now[d, b]
            if counted[d]:
                length += chord[d] * chord[d]
                change += (rates_then[d, b] - rates[d, b]) ** 2
        bow = step / 4 * math.sqrt(change)
        distance_then = np.inf
        for region in range(len(halves)):
            _offset(centers[region], period, then, b, last)
            distance_then = min(distance_then, _box_distance(last, halves[region], chord)[0])
        if (distance[b] + distance_then - math.sqrt(length)) / 2 - bow < least[b]:
            for region in range(len(halves)):
                _offset(centers[region], period, now, b, first)
                _offset(centers[region], period, then, b, last)
                on_chord = _least_on_chord(first, last, halves[region], period, chord, place)
                least[b] = min(least[b], on_chord - bow)
        distance[b] = distance_then
