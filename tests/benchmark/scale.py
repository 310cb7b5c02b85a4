"""One task at one size, in a process of its own: python -m tests.benchmark.scale SYSTEM COUNT ...

Prints a row of scale.csv as JSON. The first line of memory is therefore this size's alone.
"""

from __future__ import annotations

from tests.benchmark import timing  # before numpy, which is told to use one thread

# isort: split

import json
import sys
import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from tqdm import tqdm

from experiments.tracking.environment import peak_memory
from mlci.diagnosis import diagnose
from mlci.evidence import rank_constraints
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.simulate import step_count
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System
from mlci.tabular import action_grid, discretize
from tests.benchmark.configs import telescope
from tests.benchmark.kernels import step_floor

HORIZON, DT = 5.0, 0.25  # [s]


@dataclass(frozen=True, eq=False)
class Torus(System):
    """Four angles that push each other: no move leaves, so most cells are soon active."""

    @cached_property
    def space(self) -> StateSpace:
        return StateSpace(Box(np.zeros(4), np.full(4, 2 * np.pi)), np.ones(4, bool), tuple("abcd"))

    @cached_property
    def control_box(self) -> Box:
        return Box(np.array([-2.0, -1.0]), np.array([2.0, 1.0]))

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        pushes = np.sin(states)
        rates = (
            controls[..., 0] + pushes[..., 1],
            controls[..., 1] + pushes[..., 2],
            controls[..., 1] + pushes[..., 0],
            pushes[..., 0] - controls[..., 0],
        )
        return np.stack(np.broadcast_arrays(*rates), axis=-1)

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        batch = np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])
        slopes, by_state = np.cos(states), np.zeros((*batch, 4, 4))
        by_state[..., 0, 1], by_state[..., 1, 2] = slopes[..., 1], slopes[..., 2]
        by_state[..., 2, 0] = by_state[..., 3, 0] = slopes[..., 0]
        push = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [-1.0, 0.0]])
        return by_state, np.broadcast_to(push, (*batch, 4, 2))


def measure(name: str, shape: tuple[int, ...]) -> dict[str, object]:
    """Discretise, infer and rank one task."""
    if name == "telescope":
        settings = telescope()
        system, hypotheses = settings.model, settings.candidates
        box = settings.tasks.box()
        start, middle = box.lower + 0.2 * box.widths, box.lower + 0.8 * box.widths
        offsets = settings.tasks.goal_offsets
        goal = Box(middle + offsets.lower, middle + offsets.upper)
    else:
        system = Torus()
        hypotheses = Regions.from_grid(system.space, (10, None, 10, None))
        start, free = np.array([5.4, 0.0, 0.7, 0.0]), np.array([0.0, np.inf, 0.0, np.inf])
        goal = Box(np.array([0.5, 0.0, 1.1, 0.0]) - free, np.array([0.8, 0.0, 1.3, 0.0]) + free)
    grid, actions = Grid(system.space, shape), action_grid(system, [5, 3])
    steps, clock = step_count(HORIZON, DT), [time.process_time()]

    with tqdm(total=grid.size, unit="cell", leave=False, disable=None) as bar:
        model = discretize(
            system, grid, actions, DT, hypotheses, progress=lambda done, _: bar.update(done - bar.n)
        )
    clock.append(time.process_time())
    distribution = TrajectoryDistribution(model, int(grid.index(start)), grid.cells_in(goal), steps)
    log_z = distribution.log_z
    clock.append(time.process_time())
    phi = distribution.violation_probabilities()
    clock.append(time.process_time())
    rank_constraints(phi[None], np.zeros((1, len(phi)), dtype=bool))
    clock.append(time.process_time())
    peak = peak_memory()
    active = np.sum(log_z > -np.inf, axis=1)
    seconds = np.diff(clock)
    return {
        "system": name,
        "states": grid.size,
        "actions": len(actions),
        "hypotheses": len(hypotheses),
        "steps": steps,
        "dt": DT,
        "moves_allowed": round(1 - diagnose(model).leave, 4),
        "largest_active_share": round(float(np.max(active)) / grid.size, 4),
        "cells_active": int(np.sum(active)),
        "discretise_s": round(float(seconds[0]), 4),
        "discretise_floor_s": round(step_floor(model), 4),
        "partition_s": round(float(seconds[1]), 4),
        "violation_s": round(float(seconds[2]), 4),
        "rank_s": round(float(seconds[3]), 6),
        "infer_s": round(float(seconds[1:].sum()), 4),
        "total_s": round(float(seconds.sum()), 4),
        "peak_mb": peak,
        **timing.machine(),
    }


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], tuple(map(int, sys.argv[2:])))))
