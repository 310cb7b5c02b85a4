"""Crossings that count: how deep a path gets into a region, and how long it stays there.

The paper counts every touch of a region's interior. Recordings are noisy, and one bad sample inside
the true constraint would refute it for ever; so a crossing may be asked to reach a depth, and to
last. Both are exact on the polyline through the samples.

A *stay* is a longest interval of time in which the path is in the interior of a region. Its depth
is the largest share of the region's width that the path keeps to the nearest side, in the dimension
in which it keeps least: 0 at a side, 0.5 in the middle. A side at the border of the state space,
which no path can cross, does not count: at the border itself a path is deepest. In a region that
is no box the depth is half the share of its deepest level (`mlci.shapes.shape`) that the path
reaches, looked for in 33 places a chord; a predicate of truth values is equally deep, 0.5,
everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.regions import Regions
from mlci.shapes.membership import deepest_level
from mlci.shapes.spans import Spans
from mlci.spaces import Bools, Floats, Ints

_PLACES = 33  # along a part of a chord, at which depth in a region that is no box is looked for
_TINY = 1e-300  # a depth that keeps a quotient finite
_SAME_MOMENT = 1e-9  # of a duration: stays so near to each other are one


@dataclass(frozen=True)
class Crossing:
    """What a stay in a region takes to count as a crossing.

    Attributes:
        depth: least depth, as a share of the region's width.
        time: least duration [s].

    Raises:
        ValueError: a depth outside [0, 0.5), which no path reaches, or a time below 0.
    """

    depth: float = 0.0
    time: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.depth < 0.5:
            raise ValueError(f"a crossing's depth is in [0, 0.5), not {self.depth}")
        if not 0 <= self.time < np.inf:
            raise ValueError(f"a crossing's time must be 0 s or more, not {self.time}")

    @property
    def is_any(self) -> bool:
        """Whether every crossing counts."""
        return self.depth == self.time == 0

    def __str__(self) -> str:
        if not (self.depth or self.time):
            return "every crossing of a region counts"
        return (
            f"a crossing counts from {self.depth:g} of a region's width and {self.time:g} s inside"
        )


ANY = Crossing()


@dataclass(frozen=True, eq=False)
class Stays:
    """The S stays of a path in regions, by region and then by time.

    Attributes:
        region: (S,) numbers of the regions.
        begin: (S,) when the path enters [s].
        end: (S,) when it leaves [s].
        depth: (S,) how deep it gets, in the unit that was asked for; inf in a region without sides.
    """

    region: Ints
    begin: Floats
    end: Floats
    depth: Floats


def crossed(
    regions: Regions,
    paths: Sequence[ArrayLike],
    times: Sequence[ArrayLike],
    crossing: Crossing,
) -> Bools:
    """D (N, C): which regions each path crosses, as far as that counts.

    Args:
        regions: the C regions.
        paths: N paths (K+1, n), wrapped or not.
        times: of their samples (K+1,) [s], rising.
        crossing: what counts.
    """
    hits = np.zeros((len(paths), len(regions)), dtype=bool)
    for row, path, time in zip(hits, paths, times, strict=True):
        if crossing.is_any:
            row[:] = regions.violated_by(path)
            continue
        found = stays(regions, path, time)
        lasts = found.end - found.begin >= crossing.time * (1 - _SAME_MOMENT)
        row[found.region[lasts & (found.depth >= crossing.depth)]] = True
    return hits


def stays(regions: Regions, path: ArrayLike, time: ArrayLike, unit: Floats | None = None) -> Stays:
    """The stays of a path in regions.

    Args:
        regions: the C regions.
        path: (K+1, n) path of at least two samples, wrapped or not.
        time: (K+1,) of its samples [s], rising.
        unit: (n,) in which depth is measured in each dimension; None takes each region's width.
    """
    path, time = np.asarray(path, dtype=float), np.asarray(time, dtype=float)
    steps = regions.space.difference(path[1:], path[:-1])
    starts = regions.space.wrap(path[:-1])
    chord, image, enter, leave = regions.chord_hits(starts, steps)
    enter, leave = np.maximum(enter, 0.0), np.minimum(leave, 1.0)
    numbers, lower, upper = regions.images
    region, corners = numbers[image], (lower[image], upper[image])
    depth = _depth(regions, starts[chord], steps[chord], corners, (enter, leave), unit)
    for i in np.flatnonzero(~regions.are_boxes).tolist():
        parts = regions.shape(i).spans(regions.space, starts, steps)
        deep = _depth_by_level(regions, i, starts, steps, parts, unit)
        columns = chord, region, enter, leave, depth
        more = parts.chord, np.full(len(deep), i), parts.enter, parts.leave, deep
        chord, region, enter, leave, depth = map(np.append, columns, more)
    lasts = np.diff(time)
    begin, end = (time[chord] + share * lasts[chord] for share in (enter, leave))
    order = np.lexsort([begin, region])
    region, begin, end, depth = region[order], begin[order], end[order], depth[order]
    apart = begin[1:] > end[:-1] + _SAME_MOMENT * (time[-1] - time[0])
    first = np.flatnonzero(np.append(True, (region[1:] != region[:-1]) | apart)[: len(region)])
    if not len(first):
        return Stays(region, begin, end, depth)
    last = np.append(first[1:], len(region)) - 1
    return Stays(region[first], begin[first], end[last], np.maximum.reduceat(depth, first))


def _depth_by_level(
    regions: Regions, index: int, starts: Floats, steps: Floats, parts: Spans, unit: Floats | None
) -> Floats:
    """(E,) how deep parts of chords get into a region that is no box, see the module's head."""
    space, shape = regions.space, regions.shape(index)
    share = np.linspace(parts.enter, parts.leave, _PLACES, axis=1)[..., None]
    states = starts[parts.chord][:, None] + share * steps[parts.chord][:, None]
    deepest = -np.min(shape.level(space, states), axis=1, initial=0.0)
    if unit is not None:
        return np.asarray(deepest / np.max(unit[np.isfinite(regions.lower[index])]))
    width = 2 * max(-deepest_level(space, shape), np.max(deepest, initial=_TINY))
    return np.asarray(deepest / width)


def _depth(
    regions: Regions,
    starts: Floats,
    steps: Floats,
    corners: tuple[Floats, Floats],
    shares: tuple[Floats, Floats],
    unit: Floats | None,
) -> Floats:
    """(H,) how deep each part of a chord gets into its box.

    The distance from a side is linear along a chord, so the least of them is concave: its maximum
    is at an end of the part, or where two of the lines meet.
    """
    bounds, periodic = regions.space.bounds, regions.space.periodic
    lower, upper = corners
    with np.errstate(invalid="ignore"):
        width = np.where(np.isfinite(lower), upper - lower, 1.0) if unit is None else unit
    from_lower = np.where(~periodic & (lower <= bounds.lower), np.inf, (starts - lower) / width)
    to_upper = np.where(~periodic & (upper >= bounds.upper), np.inf, (upper - starts) / width)
    heights = np.concatenate([from_lower, to_upper], axis=1)
    slopes = np.concatenate([steps / width, -steps / width], axis=1)
    slopes = np.where(np.isfinite(heights), slopes, 0.0)
    i, j = np.triu_indices(heights.shape[1], 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        meet = (heights[:, j] - heights[:, i]) / (slopes[:, i] - slopes[:, j])
    enter, leave = (share[:, None] for share in shares)
    places = np.clip(np.where(np.isfinite(meet), meet, enter), enter, leave)
    places = np.concatenate([places, enter, leave], axis=1)
    least = np.full(places.shape, np.inf)
    for height, slope in zip(heights.T, slopes.T, strict=True):
        np.minimum(least, height[:, None] + slope[:, None] * places, out=least)
    return np.asarray(np.max(least, axis=1))
