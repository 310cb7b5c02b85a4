"""Which cells of a tree matter for what a task avoids, and along which dimension.

The tabular model forgets where in its cell a trajectory is. What that does to the probability
alpha_i of avoiding region i depends on how likely the cell is to be visited, and on how much what
follows varies within it: Munos and Moore (2002, "Variable resolution discretization in optimal
control") split the cells with the largest product of the two. There what follows is a value. Here a
trajectory that is in state x at step t, in place of another state of the cell, changes alpha_i by
the change of Z_t(x) (alpha_t(x, i) - alpha_0(i)), as alpha_0 is a ratio of two sums that are linear
in Z_t alpha_t and in Z_t.

Its variance within a cell, along each dimension, is told from the neighbours across both faces. The
variance of position itself is added: in large cells nothing seems to vary, and the paths that would
show it are improbable for their size alone. Measured on the pendulum it is what counts most.
"""

from __future__ import annotations

import numpy as np

from mlci.cells.box_tree import BoxTree
from mlci.maxent import TrajectoryDistribution
from mlci.spaces import Floats, Ints

_OF_POSITION = 100.0  # weight of the variance of position, in squared widths of the space
_LARGEST = 3.0  # nat: differences of log Z between neighbours count up to this
_HAIR = 1e-9  # of a cell's side: how far beyond a face a neighbour is looked for
_RARE = 1e-9  # probabilities of a visit below which nothing is asked


def importance(distribution: TrajectoryDistribution, tree: BoxTree) -> Floats:
    """(S, n) of each cell along each dimension: visits times variance, mean over the regions.

    Of a task that the cells cannot do, each cell that can be occupied counts alike, by its size.

    Args:
        distribution: of a task, on a model with these cells.
        tree: the cells.
    """
    size = np.square(tree.sides / tree.space.bounds.widths)
    if not distribution.is_possible:
        reached = distribution.reachable[1:-1].astype(float)
        shares = reached / np.maximum(np.sum(reached, axis=1, keepdims=True), 1)
        return np.asarray(_OF_POSITION * np.sum(shares, axis=0)[:, None] * size)
    visits, log_z = distribution.occupancies(), distribution.log_z
    found = _OF_POSITION * np.sum(visits[1:-1], axis=0)[:, None] * size
    sides = neighbours(tree)
    alpha_0 = distribution.avoidance_probabilities()
    for t, alpha in distribution.avoidance_levels():
        if 0 < t < distribution.steps:
            cells = np.flatnonzero(visits[t] > _RARE)
            rest = alpha - alpha_0
            for d in range(tree.space.dimension):
                variance = _variance(tree, cells, sides[cells, d], d, log_z[t], rest)
                found[cells, d] += visits[t, cells] * variance
    return found


def neighbours(tree: BoxTree) -> Ints:
    """(S, n, 2) the cell at the middle of the lower and the upper face along each dimension, or
    -1 at a border of the space."""
    found = np.empty((tree.size, tree.space.dimension, 2), dtype=np.int64)
    for d in range(tree.space.dimension):
        for side, corner in enumerate(tree.corners):
            beyond = tree.centers.copy()
            outwards = -_HAIR if side == 0 else _HAIR
            beyond[:, d] = corner[:, d] + outwards * tree.sides[:, d]
            found[:, d, side] = tree.index(beyond)
    return found


def _variance(
    tree: BoxTree, cells: Ints, sides: Ints, d: int, log_z: Floats, rest: Floats
) -> Floats:
    """(Q,) mean over the regions of the squared change across each of some cells (Q,).

    Args:
        tree: the cells.
        cells: (Q,) some of them.
        sides: (Q, 2) their neighbours.
        d: the dimension along which these lie.
        log_z: (S,) of a step.
        rest: (S, C) alpha less that of the task.
    """
    total, count = np.zeros(len(cells)), np.zeros(len(cells))
    for other in sides.T:
        known = np.flatnonzero((other >= 0) & (log_z[other] > -np.inf))
        here, there = cells[known], other[known]
        rise = np.clip(log_z[there] - log_z[here], -_LARGEST, _LARGEST)
        of_there, of_here = np.exp(np.minimum(rise, 0)), np.exp(np.minimum(-rise, 0))
        change = of_there[:, None] * rest[there] - of_here[:, None] * rest[here]
        apart = (tree.sides[here, d] + tree.sides[there, d]) / 2
        share = np.square(tree.sides[here, d] / apart)
        total[known] += share * np.mean(np.square(change), axis=1)
        count[known] += 1
    return total / np.maximum(count, 1)
