"""Maximum causal entropy: the soft optimal policy of a world in which chance decides what follows.

The agent chooses each action by what it knows then, and cannot choose what chance does. So this is
another model than the distribution over trajectories, (2), which `mlci.maxent` and
`mlci.worlds.first_exit` give where moves are certain: that one weighs whole trajectories by e^R,
and in a world of chance would let the agent count on its luck. The policy is

    Q_t(s, a) = reward(s, a) + discount * sum over s' of P(s' | s, a) V_(t+1)(s'),
    V_t(s) = log of the sum over a of e^(Q_t(s, a)),    pi_t(a | s) = e^(Q_t(s, a) - V_t(s)),

where Q of the last step is the reward. At a goal V = 0; a trajectory need not reach one. Where all
moves are certain, nothing is discounted and all trajectories must end in the goals, both models are
the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy  # loads scipy.special and scipy.sparse when they are first used

from mlci.spaces import Bools, Floats, Ints
from mlci.worlds.flows import fixed_point, reached
from mlci.worlds.tables import Table, TablePath
from mlci.worlds.transitions import check_steps

_IMPROVEMENTS = 100  # of the policy; a dozen do, unless values grow without end
_CLOSE = 1e-9  # relative change of the values; the error that is left is about its square


@dataclass(frozen=True, eq=False)
class CausalEntropy:
    """The policy of maximum causal entropy in a table.

    Attributes:
        table: the world; `Table.under` adds constraints.
        steps: T, number of actions; None goes on for ever, or until a goal.
        discount: what a reward one step later counts, from above 0 to 1.

    Raises:
        ValueError: a horizon below 1, or a discount outside its range.
    """

    table: Table
    steps: int | None = None
    discount: float = 1.0

    def __post_init__(self) -> None:
        if self.steps is not None:
            check_steps(self.steps, "a horizon")
        if not 0 < self.discount <= 1:
            raise ValueError(f"a discount must lie in (0, 1], not {self.discount}")

    @cached_property
    def values(self) -> Floats:
        """V (T, S), V_t(s) of each step; (1, S), that of all steps, where there is no horizon.

        -inf where the agent cannot but come to a state that has no moves and is no goal.

        Raises:
            ValueError: no horizon, and values that grow without end.
        """
        if self.steps is None:
            return self._stationary_values()[None]
        values = np.empty((self.steps, self.table.states))
        after = np.zeros(self.table.states)
        for t in reversed(range(self.steps)):
            after = values[t] = self._soft_maximum(self._action_values(after))
        return values

    def policy(self, t: int = 0) -> Floats:
        """pi_t(a | s) (S, A) at a step; rows are 0 at goals and where no move may be taken."""
        if self.steps is None:
            after = self.values[0]
        else:
            last = t == self.steps - 1
            after = np.zeros(self.table.states) if last else self.values[t + 1]
        return _soft_policy(self._action_values(after))

    @property
    def expected_visits(self) -> Floats:
        """(S,) expected number of times in each state, from the start to after the last move.

        A visit after t moves counts discount^t.

        Raises:
            ValueError: the agent cannot but come to a state without moves that is no goal.
        """
        table = self.table
        if np.any(stuck := (table.start > 0) & (self.values[0] == -np.inf)):
            raise ValueError(f"no policy from {np.flatnonzero(stuck).tolist()} always has a move")
        if self.steps is None:
            return fixed_point(self._flow(self.policy()).T, table.start)
        now, visits = table.start, table.start.copy()
        for t in range(self.steps):
            now = self._flow(self.policy(t)).T @ now
            visits += now
        return visits

    def log_probability(self, path: TablePath) -> float:
        """Log probability of the actions of a path, at the states where they were taken [nat].

        -inf where the agent cannot but come to a state that has no moves and is no goal.

        Raises:
            ValueError: a path that the table does not have, or of another number of actions, unless
                it has fewer and ends in a goal.
        """
        early = len(path.actions) < (self.steps or 0) and path.states[-1] in self.table.goals
        if self.steps is not None and len(path.actions) != self.steps and not early:
            raise ValueError(
                f"{path.title} has {len(path.actions)} actions, the horizon {self.steps}"
            )
        state, row, when = path.states[:-1], self.table.moves_of(path), np.arange(len(path.actions))
        if self.steps is None:
            when = np.zeros_like(when)
            after = self.values
        else:
            after = np.vstack([self.values[1:], np.zeros(self.table.states)])
        chances = self.table.transitions[row].tocoo()
        expected = np.zeros(len(row))
        np.add.at(expected, chances.row, chances.data * after[when[chances.row], chances.col])
        action_value = self.table.reward.ravel()[row] + self.discount * expected
        possible = action_value > -np.inf
        value = self.values[when, state]
        return float(np.sum((action_value - value)[possible])) if np.all(possible) else -np.inf

    def _action_values(self, after: Floats) -> Floats:
        """Q (S, A) from the values (S,) of the step after; -inf where there is no move."""
        table = self.table
        expected = (table.transitions @ after).reshape(table.reward.shape)
        return np.where(table.allowed, table.reward + self.discount * expected, -np.inf)

    def _soft_maximum(self, action_values: Floats) -> Floats:
        """V (S,): that of the actions, and 0 at goals."""
        values = np.asarray(scipy.special.logsumexp(action_values, axis=1))
        values[self.table.goals] = 0.0
        return values

    def _flow(self, policy: Floats) -> scipy.sparse.csr_matrix:
        """(S, S) what a visit of a state brings to the next step, discounted."""
        states = self.table.states
        row, weight = np.arange(states).repeat(self.table.actions), policy.ravel()
        choice = scipy.sparse.csr_matrix(
            (weight, (row, np.arange(len(row)))), shape=(states, len(row))
        )
        return self.discount * (choice @ self.table.transitions)

    def _stationary_values(self) -> Floats:
        """V (S,) that one more step does not change; -inf where the start does not lead.

        The value of a policy solves V = sum of pi (reward - log pi) + discount * P_pi V, and the
        policy that its Q implies is better: Newton's method, which converges quadratically.
        """
        lasting = replace(self, table=replace(self.table, allowed=_lasting_moves(self.table)))
        allowed = lasting.table.allowed
        values = np.where(allowed.any(axis=1), 0.0, -np.inf)
        values[self.table.goals] = 0.0
        if not np.any(lives := values == 0.0):
            return values
        if self.discount == 1 and len(lost := _without_goal(lasting.table)):
            raise ValueError(
                f"no goal can be reached from state {lost[0]}, which the start leads to: discount, "
                "or fix a horizon"
            )
        policy = allowed / np.maximum(np.sum(allowed, axis=1, keepdims=True), 1)
        for _ in range(_IMPROVEMENTS):
            entropy = -np.sum(scipy.special.xlogy(policy, policy), axis=1)
            gain = np.sum(policy * self.table.reward, axis=1) + entropy
            before = values[lives]
            values[lives] = fixed_point(lasting._flow(policy), gain)[lives]
            if not np.all(np.isfinite(values[lives])):
                break
            if np.max(np.abs(values[lives] - before)) <= _CLOSE * np.max(1 + np.abs(before)):
                return values
            policy = _soft_policy(lasting._action_values(values))
        raise ValueError(
            "values grow without end: going round brings more than it costs. Make moves cost more, "
            "discount, or fix a horizon"
        )


def _lasting_moves(table: Table) -> Bools:
    """(S, A) moves that the start leads to, and that never lead to where no move is left."""
    allowed = table.allowed.copy()
    for _ in range(table.states):
        stuck = ~np.any(allowed, axis=1)
        stuck[table.goals] = False
        kept = allowed & (table.transitions @ stuck == 0).reshape(allowed.shape)
        if np.array_equal(kept, allowed):
            break
        allowed = kept
    row, successor = (table.transitions.multiply(allowed.reshape(-1, 1))).nonzero()
    ahead = reached(np.flatnonzero(table.start), row // table.actions, successor, table.states)
    return allowed & ahead[:, None]


def states_without_goal(table: Table) -> Ints:
    """States that a policy may come to from the start, go on from for ever, and meet no goal."""
    return _without_goal(replace(table, allowed=_lasting_moves(table)))


def _without_goal(lasting: Table) -> Ints:
    """The same, of a table whose moves all last."""
    row, successor = (lasting.transitions.multiply(lasting.allowed.reshape(-1, 1))).nonzero()
    back = reached(lasting.goals, successor, row // lasting.actions, lasting.states)
    return np.flatnonzero(lasting.allowed.any(axis=1) & ~back)


def _soft_policy(action_values: Floats) -> Floats:
    """pi (S, A) = e^(Q - V); rows are 0 where there is no move."""
    best = np.max(action_values, axis=1, keepdims=True)
    weight = np.exp(action_values - np.where(np.isfinite(best), best, 0.0))
    total = np.sum(weight, axis=1, keepdims=True)
    return np.asarray(weight / np.where(total > 0, total, 1.0))
