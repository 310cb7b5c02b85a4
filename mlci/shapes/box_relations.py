"""Boxes of a state space as corners: which are none, lie in others, or overlap.

Boxes are corners (C, n), lower and upper, which may be infinite. What they hold beyond the bounds
does not count.
"""

from __future__ import annotations

import numpy as np

from mlci.spaces import Bools, Floats, StateSpace

_SLACK = 1e-9  # of the bounds: sides closer than this are the same side

Corners = tuple[Floats, Floats]


def check_corners(space: StateSpace, lower: Floats, upper: Floats) -> None:
    """Raise a ValueError for corners of the wrong shape, an empty box, or one half free."""
    n = space.dimension
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


def boxes_inside(space: StateSpace, boxes: Corners, others: Corners) -> Bools:
    """(C,) which boxes lie entirely in one of the others; one outside the bounds is in nothing."""
    widths, periodic = space.bounds.widths, space.periodic
    slack = _SLACK * widths
    mine, theirs = _within_bounds(space, *boxes), _within_bounds(space, *others)
    covered = np.zeros(len(mine[0]), dtype=bool)
    for lower, upper in zip(*theirs, strict=True):
        ahead = mine[0] - lower
        ahead -= np.where(periodic, np.floor((ahead + slack) / widths) * widths, 0.0)
        fits = (ahead >= -slack) & (ahead + mine[1] - mine[0] <= upper - lower + slack)
        all_round = periodic & (upper - lower >= widths - slack)
        covered |= np.all(fits | all_round, axis=1)
    return np.asarray(covered & np.all(mine[1] - mine[0] > slack, axis=1))


def boxes_overlap(space: StateSpace, boxes: Corners, others: Corners) -> Bools:
    """(C,) which boxes share more than an edge with one of the others."""
    widths, periodic = space.bounds.widths, space.periodic
    slack = _SLACK * widths
    mine, theirs = _within_bounds(space, *boxes), _within_bounds(space, *others)
    shared = np.zeros(len(mine[0]), dtype=bool)
    for lower, upper in zip(*theirs, strict=True):
        # Two intervals overlap where one of them begins inside the other.
        ahead, behind = lower - mine[0], mine[0] - lower
        ahead -= np.where(periodic, np.floor((ahead + slack) / widths) * widths, 0.0)
        behind -= np.where(periodic, np.floor((behind + slack) / widths) * widths, 0.0)
        begins_in_mine = (ahead > -slack) & (ahead < mine[1] - mine[0] - slack)
        begins_in_theirs = (behind > -slack) & (behind < upper - lower - slack)
        if np.all(upper - lower > slack):
            shared |= np.all(begins_in_mine | begins_in_theirs, axis=1)
    return np.asarray(shared & np.all(mine[1] - mine[0] > slack, axis=1))


def _within_bounds(space: StateSpace, lower: Floats, upper: Floats) -> Corners:
    """Finite corners (C, n): cut to the bounds, and to one period where a box goes round."""
    bounds, periodic = space.bounds, space.periodic
    lower = np.where(periodic, lower, np.maximum(lower, bounds.lower))
    upper = np.where(periodic, upper, np.minimum(upper, bounds.upper))
    all_round = periodic & (upper - lower >= bounds.widths)
    return np.where(all_round, bounds.lower, lower), np.where(all_round, bounds.upper, upper)
