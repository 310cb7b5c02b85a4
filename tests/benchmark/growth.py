"""How time and memory grow: python -m tests.benchmark.growth FACTOR VALUE

One size in a process of its own, whose peak memory is therefore this size's alone; prints a row of
growth.csv as JSON.
"""

from __future__ import annotations

from tests.benchmark import timing  # before numpy, which is told to use one thread

# isort: split

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from experiments.tracking.environment import peak_memory
from mlci.demonstrations import Task
from mlci.evidence import rank_constraints
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.preparation import prepare
from mlci.regions import Regions
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import Pendulum, System, TelescopingPendulum
from mlci.tabular import action_grid, discretize
from tests.held_bytes import held_bytes

DT, STEPS = 0.25, 20  # [s], and steps of a task unless they are what grows


@dataclass(frozen=True, eq=False)
class Torus(System):
    """Angles that push each other: no move leaves, so most cells are soon active.

    Attributes:
        angles: n.
    """

    angles: int = 4

    @cached_property
    def space(self) -> StateSpace:
        n = self.angles
        return StateSpace(
            Box(np.zeros(n), np.full(n, 2 * np.pi)), np.ones(n, bool), tuple("abcdef"[:n])
        )

    @cached_property
    def control_box(self) -> Box:
        return Box(np.array([-2.0, -1.0]), np.array([2.0, 1.0]))

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        pushes = np.sin(states)
        n = self.angles
        rates = [controls[..., d % 2] + pushes[..., (d + 1) % n] for d in range(n)]
        return np.stack(np.broadcast_arrays(*rates), axis=-1)

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        n = self.angles
        batch = np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])
        slopes, by_state = np.cos(states), np.zeros((*batch, n, n))
        for d in range(n):
            by_state[..., d, (d + 1) % n] = slopes[..., (d + 1) % n]
        push = np.eye(2)[np.arange(n) % 2]
        return by_state, np.broadcast_to(push, (*batch, n, 2))


@dataclass(frozen=True)
class Size:
    """What one row measures; defaults are those of the other rows.

    Attributes:
        system: "telescope", "torus" or "pendulum".
        shape: of the grid.
        actions: values of each control.
        hypotheses: cells of the first and the third dimension (the second of two).
        steps: T.
        tasks: how many tasks are prepared.
        dt: time step [s].
    """

    system: str = "telescope"
    shape: tuple[int, ...] = (10, 10, 10, 10)
    actions: tuple[int, ...] = (5, 3)
    hypotheses: tuple[int, int] = (10, 10)
    steps: int = STEPS
    tasks: int = 1
    dt: float = DT


TELESCOPES = (
    *((8, 5, 5, 5), (10, 5, 10, 5), (10, 10, 10, 10), (15, 13, 15, 11), (20, 16, 20, 16)),
    *((26, 21, 26, 21), (40, 25, 40, 25)),
)
TORI = ((10, 10, 10, 10), (18, 18, 18, 18), (32, 31, 32, 32))
SPACES = {2: (100, 100), 3: (22, 22, 21), 4: (10,) * 4, 5: (6, 6, 6, 6, 8), 6: (5, 5, 5, 5, 4, 4)}

# What grows, and the sizes at which it is measured.
FACTORS: dict[str, dict[int, Size]] = {
    "states": {int(np.prod(shape)): Size(shape=shape) for shape in TELESCOPES},
    "torus_states": {int(np.prod(shape)): Size("torus", shape) for shape in TORI},
    "hypotheses": {
        first * second: Size(hypotheses=(first, second))
        for first, second in ((5, 2), (10, 10), (40, 25), (100, 100))
    },
    "demonstrations": {
        tasks: Size("pendulum", (20, 20), (9,), tasks=tasks) for tasks in (1, 10, 100, 1000)
    },
    "actions": {
        first * second: Size(actions=(first, second))
        for first, second in ((3, 3), (5, 3), (15, 5), (25, 15))
    },
    "steps": {steps: Size(steps=steps) for steps in (10, 20, 80, 320)},
    "dimensions": {n: Size("torus", shape, (3, 3), dt=0.5) for n, shape in SPACES.items()},
}


def systems(size: Size) -> tuple[System, Floats, Box]:
    """The system, a start, and a goal that leaves velocities free."""
    free = np.inf
    if size.system == "telescope":
        goal = Box([0.38, -free, 9.32, -free], [0.58, free, 9.92, free])  # type: ignore[arg-type]
        return TelescopingPendulum(), np.array([-0.48, 0.0, 6.38, 0.0]), goal
    if size.system == "pendulum":
        return Pendulum(), np.array([0.5, 0.0]), Box.point([3.0, 0.0])
    n = len(size.shape)
    start = 0.7 + 1.1 * np.arange(n)  # no two alike, which would stay so
    around = np.where(np.arange(n) < 2, 1.0, free)
    return Torus(n), start, Box(start + 0.5 - around, start + 0.5 + around)


def infer_one(model: Any, size: Size, start: Floats, goal: Box) -> tuple[list[float], int, int]:
    """Seconds of log Z with Phi and of ranking one task; active cells, and most at a step."""
    clock = [time.process_time()]
    where = int(model.grid.index(start)), model.grid.cells_in(goal)
    distribution = TrajectoryDistribution(model, *where, size.steps)
    avoidance = distribution.avoidance_probabilities()  # and log Z, in one pass
    clock.append(time.process_time())
    rank_constraints(avoidance[None], np.zeros((1, len(avoidance)), dtype=bool))
    clock.append(time.process_time())
    active = np.sum(distribution.log_z > -np.inf, axis=1)
    return np.diff(clock).tolist(), int(active.sum()), int(active.max())


def infer_many(model: Any, size: Size) -> tuple[list[float], int, int]:
    """The same of many tasks between random states, whose active cells are not counted."""
    rng, bounds = np.random.default_rng(0), Box(np.array([0.0, -2.0]), np.array([2 * np.pi, 2.0]))
    ends = rng.uniform(bounds.lower, bounds.upper, (size.tasks, 2, 2))
    tasks = [Task(first, Box.point(last), size.steps * size.dt) for first, last in ends]
    clock = [time.process_time()]
    prepared = prepare(model, tasks)
    clock.append(time.process_time())
    avoidance = prepared.avoidance
    rank_constraints(avoidance, np.zeros(avoidance.shape, dtype=bool))
    clock.append(time.process_time())
    return np.diff(clock).tolist(), 0, 0


def warm_up() -> None:
    """Load what machine code there is, on a model of four cells."""
    system = Pendulum()
    model = discretize(
        system, Grid(system.space, (2, 2)), [[0.0]], DT, Regions.from_grid(system.space, (2, 2))
    )
    prepare(model, [Task(np.array([0.5, 0.0]), Box.point([3.0, 0.0]), DT)])
    TrajectoryDistribution(model, 0, np.arange(4), 1).violation_probabilities()


def measure(factor: str, value: int) -> dict[str, object]:
    """Discretise, infer and rank at one size."""
    size = FACTORS[factor][value]
    system, start, goal = systems(size)
    n = len(size.shape)
    of_regions = [None] * n
    of_regions[0], of_regions[2 if n == 4 else 1] = size.hypotheses
    hypotheses = Regions.from_grid(system.space, of_regions)
    grid, actions = Grid(system.space, size.shape), action_grid(system, size.actions)
    warm_up()
    imported, begin = peak_memory(), time.process_time()
    model = discretize(system, grid, actions, size.dt, hypotheses)
    discretised = time.process_time() - begin
    many: Callable[[], Any] = lambda: infer_many(model, size)  # noqa: E731
    seconds, active, most = many() if size.tasks > 1 else infer_one(model, size, start, goal)
    peak = peak_memory()
    kept = held_bytes(model) + (size.steps + 1) * grid.size * 8
    return {
        "factor": factor,
        "value": value,
        "system": size.system,
        "states": grid.size,
        "dimensions": n,
        "actions": len(actions),
        "hypotheses": len(hypotheses),
        "demonstrations": size.tasks,
        "steps": size.steps,
        "dt": size.dt,
        "largest_active_share": round(most / grid.size, 4),
        "cells_active": active,
        "discretise_s": round(discretised, 5),
        "violation_s": round(seconds[0], 5),
        "rank_s": round(seconds[1], 6),
        "infer_s": round(sum(seconds), 5),
        "total_s": round(discretised + sum(seconds), 5),
        "peak_mb": peak,
        "imports_mb": imported,
        "floor_mb": round(imported + kept / 1e6),
        **timing.machine(),
    }


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], int(sys.argv[2]))))
