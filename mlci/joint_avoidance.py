"""The probability of avoiding several regions at once, which is not the product of that of each.

Of the trajectories that avoid a set B, some share avoids i too: alpha_(B+i) = Z_B / Z alpha_(i|B),
where Z_B and alpha_(i|B) are those of the distribution whose moves cross no region of B. So one
recursion gives the probability of avoiding B together with each of all regions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlci.recursions import Leg, backward_pass
from mlci.spaces import Bools, Floats, Ints


def log_avoidance_beside(
    legs: Sequence[Leg], reachable: Bools, goal: Ints, start: int, log_z: float, others: Bools
) -> Floats:
    """log alpha (C,) [nat] of crossing neither some regions nor i; -inf where that is impossible.

    Args:
        legs: moves, and the steps from which and to which they are taken.
        reachable: (T+1, S) whether a cell can be occupied at a step.
        goal: (G,) goal cells.
        start: start cell, from which some goal can be reached.
        log_z: log Z of the start, where nothing is forbidden [nat].
        others: (C,) mask of the regions to avoid beside i; with i among them, it is alpha of these.
    """
    without = [(moves.under(others), early, late) for moves, early, late in legs]
    constrained, alpha = backward_pass(without, reachable, goal, start, len(others))
    share = constrained[0, start] - log_z if np.any(others) else 0.0
    if share == -np.inf:
        return np.full(len(others), -np.inf)
    with np.errstate(divide="ignore"):
        return np.asarray(min(share, 0.0) + np.log(alpha))
