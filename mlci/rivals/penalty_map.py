"""Maximum causal entropy inverse reinforcement learning of a map of penalties (Ziebart 2010).

A penalty theta_i >= 0 is paid for each move that belongs to hypothesis i. The log likelihood of the
demonstrations, less |theta| / spread, is concave in theta where moves are certain; its gradient is

    expected moves of i under theta - moves of the demonstrators - 1 / spread,

climbed by Adam (Kingma and Ba 2015) and clipped at 0. Without the prior, penalties of what nobody
enters would grow without end.
"""

from __future__ import annotations

import numpy as np

from mlci.rivals.problem import Problem
from mlci.spaces import Floats

_RATE = 0.5  # [nat] of a step, at most about that much


def penalty_map(problem: Problem, iterations: int = 30, spread: float = 20.0) -> Floats:
    """(C,) penalties of the hypotheses [nat].

    Args:
        problem: demonstrations and their tasks.
        iterations: of the ascent.
        spread: mean of the exponential prior of a penalty [nat], for all demonstrations together.
    """
    tasks = [(agent, numbers) for agent, numbers in problem.tasks if agent.is_possible]
    count = max(1, sum(len(numbers) for _, numbers in tasks))
    shown = np.zeros(problem.regions)
    for _, numbers in tasks:
        shown += sum(problem.moves_inside(j) for j in numbers) / count
    theta = mean = square = np.zeros(problem.regions)
    for k in range(1, iterations + 1):
        gradient = -shown - 1 / (spread * count)
        for agent, numbers in tasks:
            flows = agent.with_penalties(theta).flows
            gradient = gradient + len(numbers) / count * (agent.table.crosses.T @ flows)
        mean, square = 0.9 * mean + 0.1 * gradient, 0.99 * square + 0.01 * gradient**2
        ascent = mean / (1 - 0.9**k) / (np.sqrt(square / (1 - 0.99**k)) + 1e-4)
        theta = np.maximum(theta + _RATE * ascent, 0.0)
    return theta
