"""Are intervals of sampled paths right? python -m tests.benchmark.sampled_coverage --help

Each task is drawn anew and done by sampled paths and by cells of two sizes; the difference between
these estimates the error of the finer ones. OUT.csv has a row for each task and region: Phi by
sampled paths with its standard error, and Phi by coarse and by fine cells.
"""

from __future__ import annotations

from tests.benchmark import timing  # noqa: F401  before numpy, which is told to use one thread

# isort: split

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mlci.cells.refinement import refine
from mlci.demonstrations import Task
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.sampled.model import SampledModel
from mlci.spaces import Box, Floats
from mlci.systems import Pendulum, System, TelescopingPendulum
from mlci.tabular import TabularModel, action_grid, discretize

DT, HORIZON = 0.25, 5.0  # [s]
LEVEL = 1.96  # standard errors of a 95 % interval
BETWEEN = 0.01, 0.99  # values of Phi whose intervals are counted


@dataclass(frozen=True, eq=False)
class World:
    """A system, its regions and tasks, and cells that can do these.

    Attributes:
        system: the system.
        regions: the C regions.
        actions: (A, m) controls of the cells.
        limit: range of controls that the actions stand for.
        draw: draws a task.
        cells: Phi (C,) of a task by so many cells along a side, or in all.
    """

    system: System
    regions: Regions
    actions: Floats
    limit: Box
    draw: Callable[[np.random.Generator], Task]
    cells: Callable[[World, Task, int], Floats | None]


def pendulum() -> World:
    """The paper's, with a goal of one of 60 x 60 cells, which finer grids split evenly."""
    system, coarse = Pendulum(), Grid(Pendulum().space, (60, 60))

    def draw(rng: np.random.Generator) -> Task:
        start, goal = rng.uniform([0.0, -2.0], [2 * np.pi, 2.0], (2, 2))
        lower, upper = (corners[coarse.index(goal)] for corners in coarse.corners)
        return Task(start, Box(lower + 1e-9, upper - 1e-9), HORIZON)

    formed: dict[int, TabularModel] = {}

    def phi(world: World, task: Task, side: int) -> Floats | None:
        if side not in formed:
            grid = Grid(system.space, (side, side))
            formed[side] = discretize(system, grid, world.actions, DT, world.regions)
        return _phi(formed[side], task)

    actions, limit = _actions(system, np.array([6.0]), 25)
    return World(system, Regions.from_grid(system.space, (10, 10)), actions, limit, draw, phi)


def telescope() -> World:
    """The telescoping pendulum of conf/system, on cells that are refined for each task."""
    system = TelescopingPendulum()
    regions = Regions.from_grid(system.space, (10, None, 10, None))

    def draw(rng: np.random.Generator) -> Task:
        start, goal = rng.uniform([-0.8, 0.0, 5.3, 0.0], [0.8, 0.0, 10.7, 0.0], (2, 4))
        half = np.array([0.1, np.inf, 0.3, np.inf])
        return Task(start, Box(goal - half, goal + half), HORIZON)

    def phi(world: World, task: Task, count: int) -> Floats | None:
        grid = Grid(system.space, (10, 5, 10, 5))
        first = TabularModel(system, grid, world.actions, DT, world.regions, 2)
        return _phi(refine(first, [task], count, growth=1.0), task)

    actions, limit = _actions(system, system.control_box.upper, [5, 5])
    return World(system, regions, actions, limit, draw, phi)


WORLDS = {"pendulum": pendulum, "telescope": telescope}


def main() -> None:
    """Do tasks, one after the other, until all are done or time is up."""
    parser = argparse.ArgumentParser(prog="sampled_coverage", description=__doc__)
    parser.add_argument("out", type=Path, metavar="OUT.csv")
    parser.add_argument("--world", choices=sorted(WORLDS), default="pendulum")
    parser.add_argument("--tasks", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--samples", type=int, default=4000)
    parser.add_argument("--cells", type=int, nargs=2, metavar=("COARSE", "FINE"))
    parser.add_argument("--seconds", type=float, default=np.inf, help="after which none begins")
    asked = parser.parse_args()
    world, begin = WORLDS[asked.world](), time.time()
    model = SampledModel(
        world.system, world.regions, DT, samples=asked.samples, seed=asked.seed, limit=world.limit
    )
    rows: list[pd.DataFrame] = []
    for number in range(asked.tasks):
        if time.time() - begin > asked.seconds:
            break
        task = world.draw(np.random.default_rng([asked.seed, number]))
        of_task = _rows(world, model, task, asked.cells)
        if of_task is not None:
            rows.append(of_task.assign(task=number))
            pd.concat(rows).to_csv(asked.out, index=False)
        print(f"task {number}: {time.time() - begin:.0f} s", flush=True)
    print(summary(pd.concat(rows)))


def _rows(world: World, model: SampledModel, task: Task, cells: tuple[int, int]) -> Any:
    """A row a region of a task that both models can do; else nothing."""
    sampled = model.distribution(task)
    coarse, fine = (world.cells(world, task, count) for count in cells)
    if coarse is None or fine is None or not sampled.is_possible:
        return None
    return pd.DataFrame(
        {
            "region": world.regions.names,
            "phi": sampled.violation_probabilities(),
            "error": sampled.avoidance_errors(),
            "coarse": coarse,
            "fine": fine,
            "trusted": sampled.diagnosis.trusted,
        }
    )


def summary(rows: pd.DataFrame) -> str:
    """The share of pairs of a task and a region within 95 % intervals, as a sentence a line.

    Intervals by the samples alone; with the difference of both cells as the error of the finer
    ones; with a third of it, as where errors fall with the square of a side that is halved; and
    with the root mean square of the differences of a task, as one region's may be small by chance.
    """
    told = rows[rows["trusted"] & rows["fine"].between(*BETWEEN)]
    gap, apart = (told["phi"] - told["fine"]).abs(), (told["fine"] - told["coarse"]).abs()
    tasks = f"{told['task'].nunique()} tasks trusted of {rows['task'].nunique()}"
    lines = [f"{len(told)} pairs of {tasks}; mean |Phi - cells| {gap.mean():.4f}"]
    typical = np.sqrt(np.square(apart).groupby(told["task"]).transform("mean"))
    for words, of_cells in {
        "no error": 0.0,
        "the difference": apart,
        "a third": apart / 3,
        "the task's difference": typical,
    }.items():
        within = gap < LEVEL * np.hypot(told["error"], of_cells)
        by_task = within.groupby(told["task"]).mean()
        error = by_task.std() / np.sqrt(len(by_task))
        lines.append(f"{words} of cells: {within.mean():.3f} within (+- {error:.3f} by tasks)")
    return "\n".join(lines)


def _actions(system: System, most: Floats, count: int | list[int]) -> tuple[Floats, Box]:
    """Even actions up to a size, and the range that they stand for."""
    half = most / (np.broadcast_to(count, most.shape) - 1)
    return action_grid(system, count, Box(-most, most)), Box(-most - half, most + half)


def _phi(model: TabularModel, task: Task) -> Floats | None:
    """Phi (C,) by cells, or None where they cannot do the task."""
    way = TrajectoryDistribution.of_task(model, task, exact_ends=True)
    return way.violation_probabilities() if way.is_possible else None


if __name__ == "__main__":
    main()
