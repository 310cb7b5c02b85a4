"""The maximum entropy distribution over trajectories of any length that end at their first goal.

In a table whose moves are certain, a trajectory from state s has probability e^R / Z(s), where R is
the sum of its rewards and Z(s) the sum of e^R over all trajectories from s to their first goal:

    Z(s) = sum over moves from s of e^reward Z(s'),    Z(goal) = 1.

That is a linear system, (I - W) Z = b. Its solution is the sum if and only if the spectral radius
of W is below 1; else long detours weigh more than they cost, and the sum diverges. Over states that
are reachable from the start and from which a goal is, the radius is below 1 exactly if there is a
solution that is positive everywhere.

Z itself would underflow in a large world. So the system is solved for Z over the sum of its first
terms, the trajectories of no more moves than the best ones have: numbers from 1 upwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.spaces import Floats, Ints
from mlci.worlds.flows import fixed_point, reached, spectral_radius
from mlci.worlds.tables import Table

_UNDERFLOWS = 1e-290  # probabilities below lose their digits, or are taken for 0


@dataclass(frozen=True, eq=False)
class FirstExit:
    """The distribution of trajectories from each start to its first goal.

    Attributes:
        table: the world, whose moves are certain; `Table.under` adds constraints.
    """

    table: Table

    @cached_property
    def log_z(self) -> Floats:
        """(S,) log of the sum of e^R over the trajectories from a state to their first goal [nat].

        -inf where no goal can be reached, and for states that the start does not lead to.

        Raises:
            ValueError: the sum diverges, or chance decides what follows some move.
        """
        state, successor, reward = self._moves
        log_z = np.full(self.table.states, -np.inf)
        first = _first_terms(state, successor, reward, self.table.goals, self.table.states)
        weight = np.exp(reward + first[successor] - first[state])
        inner = np.unique(state)
        ends = np.searchsorted(inner, state), np.searchsorted(inner, successor)
        shape = len(inner), len(inner)
        between = ~np.isin(successor, self.table.goals)
        within = ends[0][between], ends[1][between]
        exits = np.zeros(len(inner))
        np.add.at(exits, ends[0][~between], weight[~between])
        scaled = fixed_point(scipy.sparse.csr_matrix((weight[between], within), shape=shape), exits)
        if not np.all(scaled > 0.5):  # each is 1 or more, if the sum converges
            growth = spectral_radius(
                scipy.sparse.csr_matrix((np.exp(reward[between]), within), shape=shape)
            )
            raise ValueError(
                "the sum over trajectories diverges: with every step, those still on their way "
                f"gain weight by a factor of {growth:.4g}. Make moves cost more, or fix a horizon"
            )
        log_z[inner] = first[inner] + np.log(scaled)
        log_z[self.table.goals] = 0.0
        return log_z

    @cached_property
    def _moves(self) -> tuple[Ints, Ints, Floats]:
        """State (L,), successor (L,) and reward (L,) of the moves on some way from start to goal,
        in order of state."""
        table = self.table
        state, action = np.nonzero(table.allowed)
        successor = table.successor[state, action]
        ahead = reached(np.flatnonzero(table.start), state, successor, table.states)
        back = reached(table.goals, successor, state, table.states)
        on_way = ahead[state] & back[successor]
        return state[on_way], successor[on_way], table.reward[state, action][on_way]

    @property
    def policy(self) -> Floats:
        """(S, A) probability of each action; rows are 0 where no trajectory goes on."""
        table = self.table
        value = np.where(table.allowed, table.reward + self.log_z[table.successor], -np.inf)
        there = np.isfinite(self.log_z)
        policy = np.zeros(value.shape)
        policy[there] = np.exp(value[there] - self.log_z[there, None])
        return policy

    def log_avoidance(self, starts: Ints, regions: Ints) -> Floats:
        """log alpha (P, L): of making no move of a region, from each of some starts [nat].

        alpha is the probability of coming to a goal by moves of the policy that do not belong to
        the region, a linear system for each region; where it underflows, Z_i / Z gives its log.

        Args:
            starts: (P,) states from which a goal can be reached.
            regions: (L,) numbers of hypotheses.

        Raises:
            ValueError: a start from which no goal can be reached.
        """
        table = self.table
        self._require_possible(starts)
        state, action = np.nonzero(policy := self.policy)
        share, successor = policy[state, action], table.successor[state, action]
        inner = np.flatnonzero(
            np.isfinite(self.log_z) & ~np.isin(np.arange(table.states), table.goals)
        )
        place = np.full(table.states, -1)
        place[inner] = np.arange(len(inner))
        begin, end = place[state], place[successor]
        belongs = table.crosses[state * table.actions + action].tocsc()
        result = np.empty((len(starts), len(regions)))
        for column, region in enumerate(regions.tolist()):
            kept = np.ones(len(share), dtype=bool)
            kept[belongs.indices[belongs.indptr[region] : belongs.indptr[region + 1]]] = False
            within, out = kept & (end >= 0), kept & (end < 0)
            exits = np.bincount(begin[out], share[out], minlength=len(inner))
            flow = scipy.sparse.csr_matrix(
                (share[within], (begin[within], end[within])), shape=(len(inner), len(inner))
            )
            alpha = np.append(fixed_point(flow, exits.astype(float)), 1.0)[
                place[starts]
            ]  # 1 at a goal
            with np.errstate(divide="ignore"):
                result[:, column] = np.log(alpha)
            if np.any(alpha < _UNDERFLOWS):
                one = table.mask([list(table.regions)[region]])
                result[:, column] = FirstExit(table.under(one)).log_z[starts] - self.log_z[starts]
        return result

    @property
    def hopeless(self) -> bool:
        """Whether no goal can be reached from any start."""
        state = self._moves[0]
        return not np.any(self.table.start[np.append(state, self.table.goals)])

    def _require_possible(self, starts: Ints) -> None:
        """Raise where there is no distribution."""
        if np.any(stuck := self.log_z[starts] == -np.inf):
            raise ValueError(f"no goal can be reached from {starts[stuck].tolist()}")

    @property
    def expected_visits(self) -> Floats:
        """(S,) expected number of times that a trajectory is in a state, its start and end counted.

        Raises:
            ValueError: a start from which no goal can be reached.
        """
        table = self.table
        self._require_possible(np.flatnonzero(table.start))
        state, action = np.nonzero(policy := self.policy)
        back = scipy.sparse.csr_matrix(
            (policy[state, action], (table.successor[state, action], state)),
            shape=(table.states, table.states),
        )
        return fixed_point(back, table.start)


def _first_terms(state: Ints, successor: Ints, reward: Floats, goals: Ints, states: int) -> Floats:
    """(S,) log of the sum of e^R over the trajectories of up to so many moves as some best one has.

    Args:
        state, successor, reward: (L,) the moves, in order of state.
        goals: (G,) where trajectories end.
        states: S.

    Raises:
        ValueError: going round in circles brings ever more reward.
    """
    best = np.full(states, -np.inf)
    best[goals] = 0.0
    log_sum = best.copy()
    if not len(state):
        return log_sum
    begins = np.flatnonzero(np.diff(state, prepend=-1))
    inner, moves = state[begins], np.diff(np.append(begins, len(state)))
    for _ in range(states):
        better = np.maximum.reduceat(reward + best[successor], begins)
        if np.array_equal(better, best[inner]):
            return log_sum
        best[inner] = better
        value = reward + log_sum[successor]
        most = np.maximum.reduceat(value, begins)
        most = np.where(most > -np.inf, most, 0.0)
        with np.errstate(divide="ignore"):
            log_sum[inner] = most + np.log(
                np.add.reduceat(np.exp(value - np.repeat(most, moves)), begins)
            )
    raise ValueError(
        "the sum over trajectories diverges: some circle of moves has a positive reward. Make "
        "moves cost more, or fix a horizon"
    )
