"""The maximum entropy distribution over tabular trajectories (section III-B) and what it implies.

A trajectory of T moves from a start cell into one of the goal cells has probability e^R / Z, (2).
Z is carried in log space: log_z[t, s] is the log of the sum of e^(reward to go) over all ways to
get from cell s at step t into a goal cell at step T, and -inf where there is none, where s cannot
be reached from the start in t moves, and so wherever no probability ever is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy import sparse

from mlci.demonstrations import Task
from mlci.simulate import step_count
from mlci.spaces import Floats, Ints
from mlci.tabular import TabularModel

_CELLS_AT_ONCE = 1 << 12  # whose moves a step of work holds
_UNEVEN = 1e-3  # of a time step: how far a horizon may be off, as recorded times are rounded
ALPHA_BYTES = 1 << 29  # of probabilities held at once, else regions go block by block


@dataclass(frozen=True, eq=False)
class TrajectoryDistribution:
    """(2) for one task, or (3) on a model under a truth: `TabularModel.under`.

    Attributes:
        model: the tabular model.
        start: start cell.
        goal: (G,) goal cells: a trajectory ends in any of them. None makes the goal unreachable.
        steps: T.

    Raises:
        ValueError: a start or a goal that is no cell, such as the -1 of a state outside the grid,
            or less than one step.
    """

    model: TabularModel
    start: int
    goal: Ints
    steps: int

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
        cls, model: TabularModel, task: Task, *, round_horizon: bool = False
    ) -> TrajectoryDistribution:
        """The distribution of a task: from the cell of its start into the cells of its goal.

        Args:
            model: the tabular model.
            task: the task.
            round_horizon: take the nearest number of time steps where dt does not divide the
                horizon.

        Raises:
            ValueError: a start outside the state space, or a horizon that dt does not divide (to a
                thousandth of a step, as recorded times are rounded).
        """
        start = int(model.grid.index(task.start))
        if start < 0:
            raise ValueError(f"the start {task.start} lies outside the state space")
        steps = max(1, round(task.horizon / model.dt))
        if not round_horizon:
            steps = step_count(task.horizon, model.dt, _UNEVEN)
        return cls(model, start, model.grid.cells_in(task.goal), steps)

    @cached_property
    def log_z(self) -> Floats:
        """(T+1, S) log Z to go [nat], by the soft Bellman backup; log_z[0, start] is log Z."""
        cells = reachable_cells(self.model, self.start, self.steps)
        return _soft_bellman_backup(self.model, cells, self.goal)

    @property
    def is_possible(self) -> bool:
        """Whether any trajectory from the start reaches a goal: else there is no distribution."""
        return bool(self.log_z[0, self.start] > -np.inf)

    def policy(self, t: int) -> tuple[Ints, Floats]:
        """pi_t(move | s) = exp(reward + log_z[t+1, s'] - log_z[t, s]), the soft optimal policy.

        Returns:
            The cells (Q,) that carry probability at step t, and (Q, M) probabilities of their
            moves, whose rows sum to 1.
        """
        cells = np.flatnonzero(self.log_z[t] > -np.inf)
        return cells, _move_probabilities(self.model, self.log_z, t, cells)

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
        support = int(np.max(np.sum(self.log_z > -np.inf, axis=1)))
        blocks = min(regions, -(-regions * 2 * 8 * support // ALPHA_BYTES))
        edges = np.linspace(0, regions, max(1, blocks) + 1).astype(int)
        alpha = np.empty(regions)
        for first, last in pairwise(edges):
            alpha[first:last] = _alpha_of_regions(self.model, self.log_z, first, last)
        return np.minimum(alpha, 1.0)

    def violation_probabilities(self) -> Floats:
        """Phi_(i,T) = 1 - alpha_i (C,): the probability that a trajectory crosses region i."""
        return 1.0 - self.avoidance_probabilities()

    def sample(self, count: int, rng: np.random.Generator) -> tuple[Ints, Ints]:
        """Draw trajectories by following the soft optimal policy.

        Returns:
            (count, T+1) cells and (count, T) moves.

        Raises:
            ValueError: no trajectory reaches a goal.
        """
        self._require_possible("nothing to sample")
        cells = [np.full(count, self.start, dtype=np.int64)]
        moves = []
        for t in range(self.steps):
            here, place = np.unique(cells[-1], return_inverse=True)
            probabilities = _move_probabilities(self.model, self.log_z, t, here)
            cumulative = np.cumsum(probabilities[place], axis=1)
            # Scaled by the last entry, so that rounding cannot lift a draw past every move.
            draws = rng.random(count)[:, None] * cumulative[:, -1:]
            moves.append(np.argmax(cumulative > draws, axis=1))
            cells.append(self.model.successor[cells[-1], moves[-1]])
        return np.stack(cells, axis=1), np.stack(moves, axis=1)

    def _require_possible(self, consequence: str) -> None:
        """Raise where there is no distribution."""
        if not self.is_possible:
            raise ValueError(f"no trajectory from cell {self.start} reaches a goal: {consequence}")


def reachable_cells(model: TabularModel, start: int, steps: int) -> list[Ints]:
    """Cells that can be occupied after t = 0 .. steps allowed moves from a start cell."""
    merged, cells = model.merged, [np.array([start], dtype=np.int64)]
    for _ in range(steps):
        move, _ = _ranges(merged.begins, cells[-1])
        mark = np.zeros(model.states, dtype=bool)
        mark[merged.successor[move[merged.log_weight[move] > -np.inf]]] = True
        cells.append(np.flatnonzero(mark))
    return cells


def _soft_bellman_backup(model: TabularModel, cells: list[Ints], goal: Ints) -> Floats:
    """log_z (T+1, S), backwards from the goal over the cells that can be occupied at each step."""
    merged, steps = model.merged, len(cells) - 1
    log_z = np.full((steps + 1, model.states), -np.inf)
    log_z[steps, np.intersect1d(cells[steps], goal)] = 0.0
    for t in reversed(range(steps)):
        for here in _parts(model, cells[t]):
            move, ends = _ranges(merged.begins, here)
            value = merged.log_weight[move] + log_z[t + 1, merged.successor[move]]
            best = np.maximum.reduceat(value, ends[:-1])
            finite = best > -np.inf
            shift = np.repeat(np.where(finite, best, 0.0), np.diff(ends))
            total = np.add.reduceat(np.exp(value - shift), ends[:-1])
            log_z[t, here[finite]] = best[finite] + np.log(total[finite])
    return log_z


def _alpha_of_regions(model: TabularModel, log_z: Floats, first: int, last: int) -> Floats:
    """alpha of the regions from `first` to before `last`, of the one cell that log_z starts in."""
    steps = len(log_z) - 1
    row_of = np.zeros(model.states, dtype=np.int64)
    cells_after = np.flatnonzero(log_z[steps] > -np.inf)
    alpha = np.ones((len(cells_after), last - first))
    for t in reversed(range(steps)):
        row_of[:] = -1
        row_of[cells_after] = np.arange(len(cells_after))
        cells = np.flatnonzero(log_z[t] > -np.inf)
        alpha_after, alpha = alpha, np.empty((len(cells), last - first))
        row = 0
        for here in _parts(model, cells):
            now = alpha[row : row + len(here)]
            now[:] = _alpha_one_step_back(model, log_z, t, here, row_of, alpha_after, first)
            row += len(here)
        cells_after = cells
    return alpha[0]


def _alpha_one_step_back(
    model: TabularModel,
    log_z: Floats,
    t: int,
    cells: Ints,
    row_of: Ints,
    alpha_after: Floats,
    first: int,
) -> Floats:
    """alpha_t (Q, C') of some cells, from alpha_(t+1) (Q', C'), whose rows `row_of` (S,) gives.

    First the sum over all moves, as a product; then, for the cells and regions that some move
    crosses, the sum over the others anew.
    """
    merged, last = model.merged, first + alpha_after.shape[1]
    move, ends = _ranges(merged.begins, cells)
    value = merged.log_weight[move] + log_z[t + 1, merged.successor[move]]
    probability = np.exp(value - np.repeat(log_z[t, cells], np.diff(ends)))
    probability /= np.repeat(np.add.reduceat(probability, ends[:-1]), np.diff(ends))
    # A successor outside the support has probability 0: whichever row stands for it.
    column = np.maximum(row_of[merged.successor[move]], 0)
    shape = len(cells), len(alpha_after)
    alpha = sparse.csr_matrix((probability, column, ends), shape=shape) @ alpha_after
    owner, entry, region = _of_cells(
        merged.crossing_begins, merged.crossing_region, cells, first, last
    )
    if len(owner):
        pair, which = np.unique(owner * (last - first) + region, return_inverse=True)
        cell_of, region_of = np.divmod(pair, last - first)
        # All moves of the cell of each pair, one pair after the other, without those that cross.
        every, begins = _ranges(ends, cell_of)
        weight = probability[every]
        place = merged.crossing_move[entry] - merged.begins[cells[owner]]
        weight[begins[which] + place] = 0.0
        weight *= alpha_after[column[every], np.repeat(region_of, np.diff(begins))]
        alpha[cell_of, region_of] = np.add.reduceat(weight, begins[:-1])
    owner, _, region = _of_cells(merged.certain_begins, merged.certain_region, cells, first, last)
    alpha[owner, region] = 0.0
    return alpha


def _of_cells(
    begins: Ints, regions: Ints, cells: Ints, first: int, last: int
) -> tuple[Ints, Ints, Ints]:
    """Entries of some cells whose regions are from `first` to before `last`.

    Returns the place in `cells` that each belongs to, its own number, and its region less `first`.
    """
    entry, ends = _ranges(begins, cells)
    owner = np.repeat(np.arange(len(cells)), np.diff(ends))
    region = regions[entry] - first
    inside = (region >= 0) & (region < last - first)
    if inside.all():
        return owner, entry, region
    return owner[inside], entry[inside], region[inside]


def _parts(model: TabularModel, cells: Ints) -> Iterator[Ints]:
    """Cells that some move leaves, in parts whose moves fit into memory and cache."""
    begins = model.merged.begins
    left = cells[begins[cells + 1] > begins[cells]]
    for first in range(0, len(left), _CELLS_AT_ONCE):
        yield left[first : first + _CELLS_AT_ONCE]


def _ranges(begins: Ints, cells: Ints) -> tuple[Ints, Ints]:
    """The numbers from begins[s] to before begins[s+1] of some cells s, and where each begin."""
    counts = begins[cells + 1] - begins[cells]
    ends = np.append(0, np.cumsum(counts))
    return np.arange(ends[-1]) + np.repeat(begins[cells] - ends[:-1], counts), ends


def _move_probabilities(model: TabularModel, log_z: Floats, t: int, cells: Ints) -> Floats:
    """(Q, M) probabilities of the moves of cells that carry probability at step t."""
    value = model.reward[cells] + log_z[t + 1, model.successor[cells]]
    value = np.where(model.allowed[cells], value, -np.inf)
    probabilities = np.exp(value - log_z[t, cells, None])
    return np.asarray(probabilities / np.sum(probabilities, axis=1, keepdims=True))
