"""Boxes and paths in the plane of two state dimensions, for pictures.

A periodic dimension is shown once. A box that leaves it on one side comes in on the other, and a
path ends at one side and goes on from the other.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mlci.regions import Regions
from mlci.spaces import Box, Floats, StateSpace

MOST_PLANES = 6
_SLACK = 1e-9  # of a side: rounding makes no slice

Rectangle = tuple[float, float, float, float]  # left, right, lower and upper side


@dataclass(frozen=True)
class Plane:
    """Two dimensions of a state space, by number.

    Attributes:
        space: the state space.
        x: the horizontal dimension.
        y: the vertical one; None where the state has one dimension, which is then drawn as a band.
    """

    space: StateSpace
    x: int
    y: int | None

    def rectangles(self, box: Box) -> tuple[Rectangle, ...]:
        """What of a box is shown: one rectangle, or one on each side where it goes round."""
        across = self._spans(box, self.x)
        up = [(0.0, 1.0)] if self.y is None else self._spans(box, self.y)
        return tuple((*a, *b) for a, b in itertools.product(across, up))

    def pieces(self, states: Floats) -> list[Floats]:
        """The path (K+1, n) as polylines (P, 2) in the plane, cut where a dimension goes round."""
        path = self.space.unwrap(states)
        y = np.full(len(path), 0.5) if self.y is None else path[:, self.y]
        pieces = [np.column_stack([path[:, self.x], y])]
        for column, d in ((0, self.x), (1, self.y)):
            if d is not None and self.space.periodic[d]:
                begin, width = self.space.bounds.lower[d], self.space.bounds.widths[d]
                pieces = [
                    part for whole in pieces for part in _cut(whole, column, begin, float(width))
                ]
        return pieces

    def _spans(self, box: Box, d: int) -> list[tuple[float, float]]:
        """The parts of a dimension's bounds that a box covers."""
        begin, end = self.space.bounds.lower[d], self.space.bounds.upper[d]
        lower, upper, width = box.lower[d], box.upper[d], end - begin
        if not np.isfinite(lower) or (self.space.periodic[d] and upper - lower >= width):
            return [(begin, end)]
        shifts = [0.0]
        if self.space.periodic[d]:
            first = np.floor((lower - begin) / width + _SLACK)
            shifts = [-first * width, -(first + 1) * width]
        spans = [(max(lower + s, begin), min(upper + s, end)) for s in shifts]
        return [(float(a), float(b)) for a, b in spans if b - a > _SLACK * width]


def planes(regions: Regions) -> list[Plane]:
    """The pairs of dimensions that are worth a map: those that regions bound, at most six.

    Where they bound one alone, it is paired with each other one.
    """
    space = regions.space
    if space.dimension == 1:
        return [Plane(space, 0, None)]
    bounded = np.flatnonzero(np.any(np.isfinite(regions.lower), axis=0)).tolist()
    if len(bounded) >= 2:
        pairs = list(itertools.combinations(bounded, 2))
    else:
        one = bounded[0] if bounded else 0
        pairs = [(min(one, d), max(one, d)) for d in range(space.dimension) if d != one]
    return [Plane(space, x, y) for x, y in pairs[:MOST_PLANES]]


def simplified(points: Floats, tolerance: float) -> Floats:
    """The fewest points (P', 2) of a polyline (P, 2) that stay within a distance of all others.

    By Douglas and Peucker (1973): a stretch keeps its farthest point, and so on in both halves.
    """
    keep, stretches = np.zeros(len(points), dtype=bool), [(0, len(points) - 1)]
    keep[[0, -1]] = True
    while stretches:
        first, last = stretches.pop()
        if last - first < 2:
            continue
        chord, rest = points[last] - points[first], points[first + 1 : last] - points[first]
        length = float(np.hypot(*chord))
        # A closed stretch has no chord to be away from.
        away = np.hypot(*rest.T)
        if length > 0:
            share = np.clip(rest @ chord / length**2, 0.0, 1.0)
            away = np.hypot(*(rest - share[:, None] * chord).T)
        farthest = int(np.argmax(away))
        if away[farthest] > tolerance:
            middle = first + 1 + farthest
            keep[middle] = True
            stretches += [(first, middle), (middle, last)]
    return points[keep]


def _cut(points: Floats, column: int, begin: float, width: float) -> list[Floats]:
    """A polyline whose coordinate runs on, in pieces that each lie in one period from `begin`."""
    pieces: list[list[Floats]] = [[]]
    place = (points[:, column] - begin) / width
    turn = int(np.floor(place[0]))
    for k, point in enumerate(points):
        while k and not turn - _SLACK <= place[k] <= turn + 1 + _SLACK:
            up = place[k] > turn
            seam = turn + 1 if up else turn
            share = (seam - place[k - 1]) / (place[k] - place[k - 1])
            crossing = points[k - 1] + share * (point - points[k - 1])
            turns = turn + (1 if up else -1)
            for ends, side in ((turn, seam - turn), (turns, seam - turns)):
                end = crossing.copy()
                end[column] = begin + side * width
                if ends != turn:
                    pieces.append([])
                pieces[-1].append(end)
            turn = turns
        shown = point.copy()
        shown[column] -= turn * width
        pieces[-1].append(shown)
    return [np.array(piece) for piece in pieces if len(piece) > 1]
