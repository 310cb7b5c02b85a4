"""The soft optimal agent of one task in a table, step by step: policy, flows, samples.

One recursion for three kinds of worlds, whose policies are those of `mlci.worlds.fixed_horizon`,
`mlci.maxent` (between cells) and `mlci.worlds.causal_entropy`:

    Q_t(s, a) = reward(s, a) + discount * sum over s' of P(s' | s, a) V_(t+1)(s'),
    V_t(s) = log of the sum over a of e^(Q_t(s, a)),    pi_t(a | s) = e^(Q_t(s, a) - V_t(s)),

with V = 0 at the table's goals, where a trajectory ends, and V_T = 0 in the states where it may be
at the last step, -inf elsewhere. Where moves are certain it is (2); where chance decides the agent
cannot count on its luck, so that it may end anywhere, and a trajectory also ends, with V = 0, where
it slips to and every way on is forbidden.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mlci.spaces import Bools, Floats, Ints
from mlci.worlds.tables import Table, TablePath
from mlci.worlds.transitions import check_steps, in_range


@dataclass(frozen=True, eq=False)
class Agent:
    """The policy of an agent who has one task.

    Attributes:
        table: the world, whose start is the task's; `Table.under` adds constraints.
        steps: T, number of moves at most.
        discount: what a reward one step later counts.
        final: (G,) states in which it has to be after T moves, or the goals before; None for any.

    Raises:
        ValueError: a horizon that is not whole or below 1, a discount outside (0, 1], or final
            states that do not exist.
    """

    table: Table
    steps: int
    discount: float = 1.0
    final: Ints | None = None

    def __post_init__(self) -> None:
        check_steps(self.steps, "an agent")
        if not 0 < self.discount <= 1:
            raise ValueError(f"an agent needs a discount in (0, 1], not {self.discount}")
        if self.final is not None:
            in_range(self.final, self.table.states, "final states")

    def under(self, mask: Bools) -> Agent:
        """The same agent under constraints, a mask (C,) of regions."""
        return replace(self, table=self.table.under(mask)) if np.any(mask) else self

    def with_penalties(self, penalties: Floats) -> Agent:
        """The same agent who pays (C,) [nat] for each move that belongs to a region."""
        price = (self.table.crosses @ penalties).reshape(self.table.reward.shape)
        return replace(self, table=replace(self.table, reward=self.table.reward - price))

    @cached_property
    def is_certain(self) -> bool:
        """Whether no move is left to chance."""
        return bool(np.all(np.diff(self.table.transitions.indptr) <= 1))

    @cached_property
    def policy(self) -> Floats:
        """pi_t(a | s) (T, S, A); rows are 0 where no trajectory goes on, as at goals."""
        table, policy = self.table, np.zeros((self.steps, *self.table.reward.shape))
        after = np.zeros(table.states)
        if self.final is not None:
            after[:] = -np.inf
            after[self.final] = 0.0
        ends = table.goals
        if self.final is None:
            ends = np.union1d(ends, np.flatnonzero(~np.any(table.allowed, axis=1)))
        after[ends] = 0.0
        for t in reversed(range(self.steps)):
            value = table.reward + self.discount * self._expected(after)
            value = np.where(table.allowed, value, -np.inf)
            most = np.max(value, axis=1)
            shift = np.where(np.isfinite(most), most, 0.0)
            weight = np.exp(value - shift[:, None])
            total = np.sum(weight, axis=1)
            policy[t] = weight / np.where(total > 0, total, 1.0)[:, None]
            with np.errstate(divide="ignore"):
                after = shift + np.log(total)
            after[ends] = 0.0
        return policy

    @property
    def is_possible(self) -> bool:
        """Whether it has a move from every start."""
        begins = np.setdiff1d(np.flatnonzero(self.table.start), self.table.goals)
        return bool(np.all(np.any(self.policy[0, begins] > 0, axis=1)))

    @cached_property
    def flows(self) -> Floats:
        """(S * A,) expected number of times that each move is made."""
        return np.sum([moving.ravel() for moving in self._moving()], axis=0)

    def _moving(self) -> Iterator[Floats]:
        """(S, A) probability of each move, step by step."""
        now = self.table.start
        for t in range(self.steps):
            moving = now[:, None] * self.policy[t]
            yield moving
            now = self.table.transitions.T @ moving.ravel()

    @property
    def expected_visits(self) -> Floats:
        """(S,) expected number of times in each state, the start counted; it rests at no goal."""
        return self.table.start + self.table.transitions.T @ self.flows

    @property
    def expected_reward(self) -> float:
        """Expected sum of discounted rewards [nat]."""
        each = [np.sum(moving * self.table.reward) for moving in self._moving()]
        return float(np.sum(each * self.discount ** np.arange(self.steps)))

    def keeps_out(self, moves: Bools) -> float:
        """Probability that it makes none of some moves, a mask (S * A,)."""
        table, stays = self.table, np.ones(self.table.states)
        allowed = ~moves.reshape(table.reward.shape)
        for t in reversed(range(self.steps)):
            after = (table.transitions @ stays).reshape(table.reward.shape)
            moving = np.sum(self.policy[t], axis=1)  # 0 or 1
            stays = 1 - moving + np.sum(self.policy[t] * allowed * after, axis=1)
        return float(table.start @ stays)

    def sample(self, count: int, rng: np.random.Generator) -> list[TablePath]:
        """Some paths of the agent, each up to its goal or the last step.

        Raises:
            ValueError: it has no move from a start.
        """
        if not self.is_possible:
            raise ValueError("this agent has no way from its start: nothing to sample")
        return [self._path(rng) for _ in range(count)]

    def _path(self, rng: np.random.Generator) -> TablePath:
        """One path."""
        states, actions = [int(rng.choice(self.table.states, p=self.table.start))], []
        chances, width = self.table.transitions, self.table.actions
        for t in range(self.steps):
            share = self.policy[t, states[-1]]
            if not np.any(share):
                break
            actions.append(_draw(share, rng))
            row = states[-1] * width + actions[-1]
            ends = slice(chances.indptr[row], chances.indptr[row + 1])
            states.append(int(chances.indices[ends][_draw(chances.data[ends], rng)]))
        return TablePath(np.array(states), np.array(actions, dtype=np.int64))

    def _expected(self, values: Floats) -> Floats:
        """(S, A) expected value of what follows each move."""
        if self.is_certain:
            return np.asarray(values[self.table.successor])
        return np.asarray((self.table.transitions @ values).reshape(self.table.reward.shape))


def _draw(shares: Floats, rng: np.random.Generator) -> int:
    """A number, with probabilities in proportion to shares."""
    cumulative = np.cumsum(shares)
    return int(np.searchsorted(cumulative, rng.random() * cumulative[-1], side="right"))
