"""The maximum entropy distribution over tabular trajectories (section III-B) and what it implies.

A trajectory of T moves from a start cell into one of the goal cells has probability e^R / Z, (2).
Z is carried in log space: log_z[t, s] is the log of the sum of e^(reward to go) over all ways to
get from cell s at step t into a goal cell at step T, and -inf where there is none, where s cannot
be reached from the start in t moves, and so wherever no probability ever is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mlci.cells.protocol import check_has_cells
from mlci.demonstrations import Task
from mlci.end_moves import first_moves, last_moves, only_moves
from mlci.joint_avoidance import log_avoidance_beside
from mlci.merged_moves import MergedMoves
from mlci.recursions import (
    Leg,
    backward_levels,
    backward_pass,
    forward_pass,
    move_probabilities,
    reachable_cells,
)
from mlci.simulate import step_count
from mlci.spaces import Bools, Box, Floats, Ints
from mlci.tabular import TabularModel

ROUNDED_TIMES = 1e-3  # of a time step: how far a horizon may be off, as recorded times are rounded


@dataclass(frozen=True, eq=False)
class Ends:
    """Where a trajectory begins and ends, as states; see `mlci.end_moves`.

    Attributes:
        start: (n,) first state.
        goal: region of the last state.
    """

    start: Floats
    goal: Box


@dataclass(frozen=True, eq=False)
class TrajectoryDistribution:
    """(2) for one task, or (3) on a model under a truth: `TabularModel.under`.

    Attributes:
        model: the tabular model.
        start: start cell.
        goal: (G,) goal cells: a trajectory ends in any of them. None makes the goal unreachable.
        steps: T.
        ends: the states at which it begins and ends; None takes cells for both, as the paper does.

    Raises:
        ValueError: a start or a goal that is no cell, such as the -1 of a state outside the grid,
            or less than one step.
    """

    model: TabularModel
    start: int
    goal: Ints
    steps: int
    ends: Ends | None = None

    def __post_init__(self) -> None:
        goal, last = np.atleast_1d(np.asarray(self.goal)), self.model.states - 1
        if not 0 <= self.start <= last:
            raise ValueError(f"the start must be a cell from 0 to {last}, not {self.start}")
        if goal.size and not (goal.min() >= 0 and goal.max() <= last):
            raise ValueError(f"goals must be cells from 0 to {last}, not {goal.tolist()}")
        if self.steps < 1:
            raise ValueError(f"a trajectory needs at least one step, not {self.steps}")
        object.__setattr__(self, "start", int(self.start))
        object.__setattr__(self, "goal", np.unique(goal.astype(np.int64)))

    @classmethod
    def of_task(
        cls,
        model: TabularModel,
        task: Task,
        *,
        round_horizon: bool = False,
        exact_ends: bool = False,
    ) -> TrajectoryDistribution:
        """The distribution of a task: from its start into its goal.

        Args:
            model: the tabular model.
            task: the task.
            round_horizon: take the nearest number of time steps where dt does not divide the
                horizon.
            exact_ends: begin and end at states, not at cells.

        Raises:
            TypeError: a model without cells that all tasks share.
            ValueError: a start outside the state space, or a horizon that dt does not divide (to a
                thousandth of a step, as recorded times are rounded).
        """
        check_has_cells(model)
        start = int(model.grid.index(task.start))
        if start < 0:
            raise ValueError(f"the start {task.start} lies outside the state space")
        steps = max(1, round(task.horizon / model.dt))
        if not round_horizon:
            steps = step_count(task.horizon, model.dt, ROUNDED_TIMES)
        ends = Ends(task.start, task.goal) if exact_ends else None
        return cls(model, start, model.grid.cells_in(task.goal), steps, ends)

    def with_temperature_of(self, model: TabularModel) -> TrajectoryDistribution:
        """The same task on the model at another temperature: `TabularModel.with_temperature`."""
        other = replace(self, model=model)
        if self.ends is not None:  # what takes the time has been done
            scale = self.model.temperature / model.temperature
            vars(other)["start_moves"] = self.start_moves.scaled(scale)
            if self.steps > 1:
                vars(other)["_between"] = self._between
                vars(other)["goal_moves"] = self.goal_moves.scaled(scale)
        return other

    @cached_property
    def log_z(self) -> Floats:
        """(T+1, S) log Z to go [nat], by the soft Bellman backup; log_z[0, start] is log Z."""
        return backward_pass(self._legs, self.reachable, self.goal, self.start, 0)[0]

    @cached_property
    def reachable(self) -> Bools:
        """(T+1, S) cells that can be occupied at each step, whether or not a goal follows."""
        if self.ends is None:
            return self._reached(self.steps)
        reached = np.zeros((self.steps + 1, self.model.states), dtype=bool)
        reached[0, self.start] = True
        if self.steps > 1:
            reached[1:-1] = self._between
            reached[-1, self.goal_moves.allowed_successors] = True
        else:
            reached[-1, self.start_moves.allowed_successors] = True
        return reached

    @cached_property
    def _between(self) -> Bools:
        """(T-1, S) cells that can be occupied after 1 .. T-1 moves from the exact start."""
        return self._reached(self.steps - 2)

    @property
    def first_cells(self) -> tuple[Ints, int]:
        """Cells from which moves of the table are taken first, and how many moves are left there:
        with exact ends those after the first move, as far as the truth allows it."""
        if self.ends is None:
            return np.array([self.start]), self.steps
        return np.unique(self.start_moves.allowed_successors), self.steps - 1

    def _reached(self, moves: int) -> Bools:
        """(moves + 1, S) cells that can be occupied after moves of the table.

        Raises:
            ValueError: the model was explored for other tasks.
        """
        (starts, steps), explored = self.first_cells, self.model.explored
        if explored is not None and not explored.serves(starts, steps, self.goal):
            raise ValueError(
                f"the model was explored for other tasks than that from cell {self.start} in "
                f"{self.steps} steps: explore(model, tasks) takes all that it is for"
            )
        return reachable_cells(self.model.merged, starts, moves)

    @cached_property
    def start_moves(self) -> MergedMoves:
        """The moves from the exact start; into the goal where there is one step."""
        assert self.ends is not None
        if self.steps == 1:
            return only_moves(self.model, self.ends.start, self.goal, self.ends.goal)
        return first_moves(self.model, self.ends.start)

    @cached_property
    def goal_moves(self) -> MergedMoves:
        """The moves that end at the exact goal."""
        assert self.ends is not None
        cells = np.flatnonzero(self._between[-1])
        return last_moves(self.model, cells, self.goal, self.ends.goal)

    @property
    def _legs(self) -> list[Leg]:
        """The moves of each part of the way."""
        if self.ends is None:
            return [(self.model.merged, 0, self.steps)]
        if self.steps == 1:
            return [(self.start_moves, 0, 1)]
        last = self.steps - 1
        between = self.model.merged, 1, last
        return [(self.start_moves, 0, 1), between, (self.goal_moves, last, last + 1)]

    @property
    def is_possible(self) -> bool:
        """Whether any trajectory from the start reaches a goal: else there is no distribution."""
        return bool(np.any(self.reachable[-1, self.goal]))

    def policy(self, t: int) -> tuple[Ints, Floats]:
        """pi_t(move | s) = exp(reward + log_z[t+1, s'] - log_z[t, s]), the soft optimal policy.

        Returns:
            The cells (Q,) that carry probability at step t, and (Q, M) probabilities of their
            moves, whose rows sum to 1.
        """
        cells = np.flatnonzero(self.log_z[t] > -np.inf)
        return cells, move_probabilities(*self.model.policy_moves(cells), self.log_z, t, cells)

    def avoidance_probabilities(self) -> Floats:
        """alpha_i (C,): the probability that a trajectory does not cross region i.

        alpha_t^i(s) = sum over the moves that do not cross i of pi_t(move | s) alpha_(t+1)^i(s'),
        backwards from alpha_T = 1. Nothing is subtracted, so that a region which no trajectory
        avoids has exactly 0, and -log alpha is exact where 1 - alpha would round to 1.

        Raises:
            ValueError: no trajectory reaches a goal.
        """
        self._require_possible("probabilities are not defined")
        regions = len(self.model.regions)
        log_z, alpha = backward_pass(self._legs, self.reachable, self.goal, self.start, regions)
        vars(self)["log_z"] = log_z  # it comes along
        return alpha

    def log_avoidance_beside(self, others: Bools) -> Floats:
        """log alpha (C,) [nat]: of crossing neither the regions of a mask (C,) nor i.

        Raises:
            ValueError: no trajectory reaches a goal.
        """
        self._require_possible("probabilities are not defined")
        log_z = float(self.log_z[0, self.start])
        return log_avoidance_beside(
            self._legs, self.reachable, self.goal, self.start, log_z, others
        )

    def avoidance_levels(self) -> Iterator[tuple[int, Floats]]:
        """Each step t from T back to 0, and alpha_t (S, C) of the way from each cell on.

        The array is overwritten; cells with infinite log_z[t] have no alpha.
        """
        return backward_levels(self._legs, self.reachable, self.goal, len(self.model.regions))

    def occupancies(self) -> Floats:
        """(T+1, S) probability of being in each cell at each step.

        Raises:
            ValueError: no trajectory reaches a goal.
        """
        self._require_possible("probabilities are not defined")
        return forward_pass(self._legs, self.log_z, self.start)

    def violation_probabilities(self) -> Floats:
        """Phi_(i,T) = 1 - alpha_i (C,): the probability that a trajectory crosses region i."""
        return 1.0 - self.avoidance_probabilities()

    def sample(self, count: int, rng: np.random.Generator) -> tuple[Ints, Ints]:
        """Draw trajectories by following the soft optimal policy.

        Returns:
            (count, T+1) cells and (count, T) moves.

        Raises:
            ValueError: no trajectory reaches a goal, or ends that are states: then the first and
                the last move are none of the table's.
        """
        self._require_possible("nothing to sample")
        if self.ends is not None:
            raise ValueError("trajectories are sampled between cells: take exact_ends=False")
        cells = [np.full(count, self.start, dtype=np.int64)]
        moves = []
        for t in range(self.steps):
            move, successor = self.draw_moves(t, cells[-1], rng)
            moves.append(move)
            cells.append(successor)
        return np.stack(cells, axis=1), np.stack(moves, axis=1)

    def draw_moves(self, t: int, cells: Ints, rng: np.random.Generator) -> tuple[Ints, Ints]:
        """A move of each of some cells (B,) at step t by the soft policy, and its successor."""
        here, place = np.unique(cells, return_inverse=True)
        successor, reward = self.model.policy_moves(here)
        probabilities = move_probabilities(successor, reward, self.log_z, t, here)
        cumulative = np.cumsum(probabilities, axis=1)[place]
        # Scaled by the last entry, so that rounding cannot lift a draw past every move.
        draws = rng.random(len(cells))[:, None] * cumulative[:, -1:]
        move = np.argmax(cumulative > draws, axis=1)
        return move, successor[place, move]

    def _require_possible(self, consequence: str) -> None:
        """Raise where there is no distribution."""
        if not self.is_possible:
            raise ValueError(f"no trajectory from cell {self.start} reaches a goal: {consequence}")
