"""The maximum entropy distribution over trajectories of a table that have a fixed number of moves.

In a table whose moves are certain, a trajectory of T moves has probability e^R / Z, (2). It has to
be in a goal at the end; one that meets a goal earlier stays there, at no reward. Where a table has
no goals, it may end anywhere. With ever more moves this becomes `mlci.worlds.first_exit`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.joint_avoidance import log_avoidance_beside
from mlci.merged_moves import MergedMoves, run_begins
from mlci.recursions import Leg, backward_pass, reachable_cells
from mlci.spaces import Bools, Floats, Ints
from mlci.worlds.tables import Table
from mlci.worlds.transitions import check_steps


@dataclass(frozen=True, eq=False)
class FixedHorizon:
    """The distribution of trajectories of T moves from each start.

    Attributes:
        table: the world, whose moves are certain; `Table.under` adds constraints.
        steps: T.

    Raises:
        ValueError: less than one step.
    """

    table: Table
    steps: int

    def __post_init__(self) -> None:
        check_steps(self.steps, "a trajectory")

    @cached_property
    def log_z(self) -> Floats:
        """(T+1, S) log Z to go [nat]; log_z[0] is log Z of each start, -inf where there is none."""
        return self._backward_pass(0, 0)[0]

    def policy(self, t: int) -> Floats:
        """(S, A) probability of each action at a step; rows are 0 where no trajectory goes on."""
        table = self.table
        value = np.where(table.allowed, table.reward + self.log_z[t + 1, table.successor], -np.inf)
        there = np.isfinite(self.log_z[t])
        policy = np.zeros(value.shape)
        policy[there] = np.exp(value[there] - self.log_z[t, there, None])
        return policy

    @property
    def expected_visits(self) -> Floats:
        """(S,) expected number of times in a state, start and end counted; staying is no visit.

        Raises:
            ValueError: a start from which no trajectory ends in a goal.
        """
        table = self.table
        self._require_possible(np.flatnonzero(table.start))
        now, visits = table.start, table.start.copy()
        for t in range(self.steps):
            flow = now[:, None] * self.policy(t)
            moving = flow > 0
            now = np.zeros(table.states)
            np.add.at(now, table.successor[moving], flow[moving])
            visits += now
        return visits

    def avoidance_probabilities(self, start: int) -> Floats:
        """alpha (C,): the probability that a trajectory from a start makes no move of a region.

        Raises:
            ValueError: no trajectory from there ends in a goal.
        """
        self._require_possible(np.array([start]))
        return self._backward_pass(start, len(self.table.regions))[1]

    def _backward_pass(self, start: int, regions: int) -> tuple[Floats, Floats]:
        """log_z (T+1, S) of all starts, and alpha (C,) of one."""
        reachable = reachable_cells(self._leg[0], np.flatnonzero(self.table.start), self.steps)
        return backward_pass([self._leg], reachable, self._ends, start, regions)

    def log_avoidance_beside(self, start: int, others: Bools) -> Floats:
        """log alpha (C,) [nat]: that it makes no move of the regions of a mask (C,) nor of i.

        Raises:
            ValueError: no trajectory from there ends in a goal.
        """
        self._require_possible(np.array([start]))
        reachable = reachable_cells(self._leg[0], [start], self.steps)
        log_z = float(self.log_z[0, start])
        return log_avoidance_beside([self._leg], reachable, self._ends, start, log_z, others)

    @property
    def _ends(self) -> Ints:
        """(G,) states in which a trajectory may end."""
        goals = self.table.goals
        return goals if len(goals) else np.arange(self.table.states)

    @cached_property
    def _leg(self) -> Leg:
        """The allowed moves in order of state, and that of each goal to itself."""
        table = self.table
        moves = table.allowed.copy()
        successor, reward = table.successor.copy(), table.reward.copy()
        moves[table.goals, 0], successor[table.goals, 0] = True, table.goals
        reward[table.goals, 0] = 0.0
        row = np.flatnonzero(moves)
        crosses = table.crosses[row]
        staying = np.isin(row // table.actions, table.goals)
        count = np.where(staying, 0, np.diff(crosses.indptr))
        regions = crosses.indices[np.repeat(~staying, np.diff(crosses.indptr))]
        return (
            MergedMoves(
                begins=run_begins(moves.sum(axis=1)),
                successor=successor[moves].astype(np.int32),
                log_weight=reward[moves],
                crossing_begins=run_begins(count),
                crossing_region=regions.astype(np.int32),
            ),
            0,
            self.steps,
        )

    def _require_possible(self, starts: Ints) -> None:
        """Raise where there is no distribution."""
        if np.any(stuck := self.log_z[0, starts] == -np.inf):
            raise ValueError(f"no trajectory from {starts[stuck].tolist()} ends in a goal")
