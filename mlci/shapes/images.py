"""Copies of boxes that lie whole periods apart: a chord that wraps is met by one of them."""

from __future__ import annotations

import numpy as np

from mlci.spaces import Floats, Ints, StateSpace


def images(space: StateSpace, lower: Floats, upper: Floats) -> tuple[Ints, Floats, Floats]:
    """The boxes' copies, whole periods apart, that a wrapped chord can reach.

    Args:
        space: the state space.
        lower: (C, n) lower corners.
        upper: (C, n) upper corners.

    Returns:
        The number of each copy's box (I,), and corners (I, n).
    """
    region, lower, upper = np.arange(len(lower)), lower.copy(), upper.copy()
    for d in np.flatnonzero(space.periodic):
        period = space.bounds.widths[d]
        free = upper[:, d] - lower[:, d] >= period
        lower[free, d], upper[free, d] = -np.inf, np.inf
        # Chords start in the bounds and are at most half a period long.
        chords_from = space.bounds.lower[d] - period / 2
        chords_to = space.bounds.upper[d] + period / 2
        first = np.where(free, 0.0, np.ceil((chords_from - upper[:, d]) / period))
        last = np.where(free, 0.0, np.floor((chords_to - lower[:, d]) / period))
        copies = [(region[:0], lower[:0], upper[:0])]
        for turns in np.arange(first.min(initial=0.0), last.max(initial=0.0) + 1):
            wanted = (first <= turns) & (turns <= last)
            shift = np.where(np.arange(space.dimension) == d, turns * period, 0.0)
            copies.append((region[wanted], lower[wanted] + shift, upper[wanted] + shift))
        region, lower, upper = map(np.concatenate, zip(*copies, strict=True))
    return region, lower, upper
