"""The probability of avoiding two regions at once, which is not the product of that of each.

Of the trajectories that avoid region i, some share avoids j too: alpha_ij = alpha_i alpha_(j|i),
where alpha_(j|i) is that of the distribution whose moves do not cross i. Nothing is subtracted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlci.recursions import Leg, backward_pass
from mlci.spaces import Bools, Floats, Ints


def joint_avoidance(
    legs: Sequence[Leg], reachable: Bools, goal: Ints, start: int, regions: int
) -> Floats:
    """alpha (C, C): the probability of crossing neither region i nor j, on the diagonal of one.

    Args:
        legs: moves, and the steps from which and to which they are taken.
        reachable: (T+1, S) whether a cell can be occupied at a step.
        goal: (G,) goal cells.
        start: start cell, from which some goal can be reached.
        regions: C.
    """
    _, alpha = backward_pass(legs, reachable, goal, start, regions)
    joint = np.diag(alpha)
    for i in np.flatnonzero(alpha[:-1]).tolist():
        alone = np.arange(regions) == i
        without = [(moves.under(alone), early, late) for moves, early, late in legs]
        log_z, rest = backward_pass(without, reachable, goal, start, regions, skip=i + 1)
        if log_z[0, start] > -np.inf:
            joint[i, i + 1 :] = joint[i + 1 :, i] = alpha[i] * rest
    return joint
