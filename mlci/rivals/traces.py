"""Scores of hypotheses by what demonstrators leave out, with no account of chance.

`visits` is what matching of feature expectations looks at (Abbeel and Ng 2004; Ziebart et al.
2008); `crossings` counts sampled unconstrained paths; `nearest` takes the hypotheses that
demonstrators pass most closely; `density` is a one-class rule for positive and unlabelled data
(Elkan and Noto 2008): the unconstrained agent's visits are unlabelled, the demonstrators' are
positive, and what is visited by the agent alone is negative. As `mlci.baselines`, which are for
tabular models, in the common form of `mlci.rivals.problem`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.rivals.problem import Problem
from mlci.spaces import Bools, Floats, Ints

_WIDTH = 0.5  # of a kernel, in widths of a hypothesis
_FLOOR = 1e-3  # visits that both densities have everywhere, so that nothing is divided by nothing


def visits(problem: Problem) -> Floats:
    """(C,) expected less empirical number of moves of each hypothesis, a mean over paths."""
    total: Floats = np.zeros(problem.regions)
    for j in range(len(problem.shown)):
        total = total - problem.moves_inside(j)
    for agent, numbers in problem.tasks:
        if agent.is_possible:
            total = total + len(numbers) * (agent.table.crosses.T @ agent.flows)
    return np.asarray(total / len(problem.shown))


def crossings(problem: Problem, paths: int, rng: np.random.Generator) -> Floats:
    """(C,) share of sampled unconstrained paths that cross each hypothesis, over all tasks."""
    total = np.zeros(problem.regions)
    for agent, numbers in problem.tasks:
        if agent.is_possible:
            sampled = agent.sample(paths, rng)
            rows = [p.states[:-1] * agent.table.actions + p.actions for p in sampled]
            owner = np.repeat(np.arange(paths), [len(row) for row in rows])
            moves = np.ones(len(owner)), (owner, np.concatenate(rows))
            made = scipy.sparse.csr_matrix(moves, shape=(paths, agent.table.crosses.shape[0]))
            total += len(numbers) * np.mean((made @ agent.table.crosses).toarray() > 0, axis=0)
    return total / len(problem.shown)


def nearest(problem: Problem) -> Floats:
    """(C,) minus the distance from each hypothesis to the nearest place that was visited."""
    places = _Places.of(problem)
    seen = np.flatnonzero(places.total(_demonstrators(problem)) > 0)
    distance = np.min(places.distances[:, seen], axis=1)
    return -np.array([np.min(distance[column], initial=np.inf) for column in places.inside.T])


def density(problem: Problem) -> Floats:
    """(C,) share of a hypothesis's smoothed visits that no demonstrator made."""
    places = _Places.of(problem)
    kernel = np.exp(-((places.distances / _WIDTH) ** 2) / 2)
    kernel /= np.sum(kernel, axis=0)
    agents, demonstrators = (
        kernel @ places.total(visits) for visits in (_agents(problem), _demonstrators(problem))
    )
    total = (agents + demonstrators + _FLOOR) @ places.inside
    return np.asarray((agents @ places.inside) / np.maximum(total, _FLOOR))


@dataclass(frozen=True, eq=False)
class _Places:
    """The P different places of states.

    Attributes:
        number: (S,) the place of each state.
        inside: (P, C) boolean: which places belong to which hypothesis.
        distances: (P, P) in widths of a hypothesis; round an axis that wraps.
    """

    number: Ints
    inside: Bools
    distances: Floats

    @classmethod
    def of(cls, problem: Problem) -> _Places:
        """Those of a problem."""
        places, first, number = np.unique(
            problem.positions, axis=0, return_index=True, return_inverse=True
        )
        gap = np.abs(places[:, None] - places[None])
        for axis, wraps in enumerate(problem.wraps):
            if wraps:
                gap[..., axis] = np.minimum(gap[..., axis], problem.shape[axis] - gap[..., axis])
        return cls(number.ravel(), problem.inside[first], np.sqrt(np.sum(gap**2, axis=-1)))

    def total(self, visits: Floats) -> Floats:
        """(P,) visits of the states (S,) of each place."""
        return np.asarray(np.bincount(self.number, visits, len(self.inside)), dtype=float)


def _agents(problem: Problem) -> Floats:
    """(S,) expected visits of the unconstrained agents, a mean over demonstrations."""
    total = np.zeros(len(problem.positions))
    for agent, numbers in problem.tasks:
        if agent.is_possible:
            total += len(numbers) * agent.expected_visits
    return total / len(problem.shown)


def _demonstrators(problem: Problem) -> Floats:
    """(S,) visits of the demonstrators, likewise."""
    states = np.concatenate([each.states for each in problem.shown])
    return np.bincount(states, minlength=len(problem.positions)) / len(problem.shown)
