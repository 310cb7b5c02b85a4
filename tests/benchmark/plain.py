"""What a student writes: the definitions as whole arrays, in numpy, and no thought of speed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import logsumexp

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.simulate import rollout
from mlci.spaces import Bools, Floats, Ints
from mlci.systems import System


@dataclass(frozen=True, eq=False)
class World:
    """A tabular problem.

    Attributes:
        name: in words.
        system, grid, actions, dt, regions: as of `mlci.discretize`.
        substeps: integrator steps of a move.
        start: (n,) first state of the task.
        goal: (G,) cells in which it ends.
        steps: T.
    """

    name: str
    system: System
    grid: Grid
    actions: Floats
    dt: float
    regions: Regions
    substeps: int
    start: Floats
    goal: Ints
    steps: int

    @cached_property
    def start_cell(self) -> int:
        """The cell of the start."""
        return int(self.grid.index(self.start))


@dataclass(frozen=True, eq=False)
class Table:
    """A tabular model.

    Attributes:
        successor: (S, A) cell after a move, S where it leaves the grid.
        reward: (S, A) [nat].
        crosses: (S, A, C) regions that a move enters.
    """

    successor: Ints
    reward: Floats
    crosses: Bools


def discretise(world: World) -> Table:
    """Every move, and every region that one of its chords meets."""
    cells, count = world.grid.size, len(world.actions)
    starts = np.repeat(world.grid.centers[:, None, :], count, axis=1)
    controls = np.broadcast_to(world.actions, (cells, *world.actions.shape))
    path = rollout(world.system, starts, controls[:, :, None, :], world.dt, world.substeps)
    inside = np.all(world.grid.space.contains(path), axis=-1)
    successor = np.where(inside, world.grid.index(path[:, :, -1]), cells)
    reward = world.system.running_reward(starts, controls) * world.dt
    crosses = np.stack(
        [_meets(world, path, *corners) for corners in zip(*corners_of(world.regions), strict=True)],
        axis=-1,
    )
    return Table(successor, np.broadcast_to(reward, successor.shape), crosses)


def corners_of(regions: Regions) -> tuple[Floats, Floats]:
    """Lower and upper corners (C, n), infinite where a region is free."""
    boxes = [regions.box(number) for number in range(len(regions))]
    return np.array([box.lower for box in boxes]), np.array([box.upper for box in boxes])


def _meets(world: World, path: Floats, lower: Floats, upper: Floats) -> Bools:
    """Which paths (S, A, K+1, n) enter the interior of a box: chord by chord, side by side."""
    first, step = path[..., :-1, :], np.diff(path, axis=-2)
    with np.errstate(invalid="ignore"):  # of its images the one that is nearest
        apart = first + step / 2 - (lower + upper) / 2
    turns = np.round(np.nan_to_num(apart) / world.grid.space.bounds.widths)
    shift = turns * world.grid.space.bounds.widths * world.grid.space.periodic
    low, high = lower + shift, upper + shift
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - first) / step, (high - first) / step
    between = (first > low) & (first < high)
    enter = np.where(step == 0, np.where(between, -np.inf, np.inf), np.minimum(one, other))
    leave = np.where(step == 0, np.inf, np.maximum(one, other))
    enter, leave = enter.max(axis=-1), leave.min(axis=-1)
    return np.asarray(np.any((enter < leave) & (enter < 1) & (leave > 0), axis=-1))


def log_partition(table: Table, goal: Ints, steps: int) -> Floats:
    """log Z to go (T+1, S+1); the last cell is where moves lead that leave the grid."""
    cells = len(table.successor)
    log_z = np.full((steps + 1, cells + 1), -np.inf)
    log_z[steps, goal] = 0.0
    for t in reversed(range(steps)):
        log_z[t, :cells] = logsumexp(table.reward + log_z[t + 1, table.successor], axis=1)
    return log_z


def log_z_and_phi(world: World, table: Table) -> tuple[float, Floats]:
    """log Z of the start, and Phi (C,): the recursion of alpha, move by move."""
    log_z = log_partition(table, world.goal, world.steps)
    cells, moves = table.successor.shape
    alpha = np.ones((cells + 1, table.crosses.shape[2]))
    for t in reversed(range(world.steps)):
        possible = log_z[t, :cells] > -np.inf
        total = np.where(possible, log_z[t, :cells], 0.0)
        value = table.reward + log_z[t + 1, table.successor] - total[:, None]
        probability = np.where(possible[:, None], np.exp(value), 0.0)
        before = np.zeros_like(alpha)
        for move in range(moves):
            after = alpha[table.successor[:, move]] * ~table.crosses[:, move]
            before[:cells] += probability[:, move, None] * after
        alpha = before
    return float(log_z[0, world.start_cell]), 1 - alpha[world.start_cell]


def visits(table: Table, log_z: Floats, start: int) -> Floats:
    """(T+1, S) probability of each cell at each step."""
    steps, cells = len(log_z) - 1, len(table.successor)
    where = np.zeros((steps + 1, cells + 1))
    where[0, start] = 1.0
    for t in range(steps):
        here = np.flatnonzero(where[t, :cells])
        value = table.reward[here] + log_z[t + 1, table.successor[here]] - log_z[t, here, None]
        np.add.at(where[t + 1], table.successor[here], np.exp(value) * where[t, here, None])
    return where[:, :cells]
