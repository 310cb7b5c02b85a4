"""The paper's evidence as it is printed: moves are certain, trajectories run from cell to cell.

Where chance decides, each move leads to its likeliest successor, which is all that (1) knows; and
nothing is discounted.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.rivals.problem import Problem
from mlci.spaces import Floats
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.tables import Table


def printed_avoidance(problem: Problem) -> Floats:
    """(N, C) alpha of each task, (4) to (6); 1 where the certain world has no way to the goal."""
    nothing, alpha = np.zeros(problem.regions, dtype=bool), np.ones(problem.violated.shape)
    for agent, numbers in problem.tasks:
        each = problem.shown[numbers[0]]
        between = each.between_cells or each.avoidance
        if between is not None:
            alpha[numbers] = np.exp(between(nothing))
            continue
        world = FixedHorizon(certain(agent.table), agent.steps)
        start = int(np.argmax(agent.table.start))
        if world.log_z[0, start] > -np.inf:
            alpha[numbers] = world.avoidance_probabilities(start)
    return np.clip(alpha, 0.0, 1.0)


def certain(table: Table) -> Table:
    """The table in which each move leads where it most probably does."""
    chances, rows = table.transitions, np.flatnonzero(np.diff(table.transitions.indptr))
    ends = [
        chances.indices[begin + np.argmax(chances.data[begin:end])]
        for begin, end in zip(chances.indptr[rows], chances.indptr[rows + 1], strict=True)
    ]
    likeliest = scipy.sparse.csr_matrix((np.ones(len(rows)), (rows, ends)), shape=chances.shape)
    return replace(table, transitions=likeliest)
