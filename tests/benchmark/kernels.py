"""Times of the main algorithms against their floors, at the paper's sizes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from experiments.config.settings import Settings
from mlci.demonstrations import Demonstration, Task
from mlci.demonstrator import demonstrate, sample_trials
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.preparation import infer, prepare
from mlci.reachability import solve_safe_set
from mlci.regions import Regions
from mlci.safety_filter import SafetyFilter, border_margin
from mlci.simulate import rk4_step
from mlci.spaces import Box
from mlci.systems import Pendulum
from mlci.tabular import TabularModel, action_grid, discretize, substep_count
from tests.benchmark.timing import Row, copy_rate, median_seconds

_BLOCK = 1 << 14  # moves, whose states stay in the cache

SYSTEM = Pendulum()
HYPOTHESES = Regions.from_grid(SYSTEM.space, (10, 10))
TRUTH = Regions(SYSTEM.space, [[np.pi, 0.0]], [[1.2 * np.pi, 1.2]])  # type: ignore[arg-type]


def phi_floor(distribution: TrajectoryDistribution) -> float:
    """Seconds to read the row of Phi of each successor and to write each cell's, once a step."""
    traffic, model, log_z = 0, distribution.model, distribution.log_z
    cell = np.repeat(np.arange(model.states), np.diff(model.merged.begins))
    pairs = np.unique(np.stack([cell, model.merged.successor]), axis=1)
    successors = np.bincount(pairs[0], minlength=model.states)
    for t in range(distribution.steps):
        cells = np.flatnonzero(log_z[t] > -np.inf)
        traffic += int(np.sum(successors[cells])) + len(cells)
    return traffic * len(model.regions) * 8 / copy_rate(1 << 19)


def exp_floor(distribution: TrajectoryDistribution) -> float:
    """Seconds to take the exponential of each merged move of each cell that has probability."""
    begins = distribution.model.merged.begins
    entries = int(np.sum((distribution.log_z > -np.inf) @ np.diff(begins)))
    return median_seconds(lambda: np.exp(np.full(entries, -1.0)))


def step_floor(model: TabularModel) -> float:
    """Seconds of the Runge-Kutta steps of all moves, from the rate of a block of them."""
    system, grid, actions = model.system, model.grid, model.actions
    cells = max(1, min(grid.size, _BLOCK // model.moves))
    points = np.repeat(grid.centers[:cells], model.moves, axis=0)
    held = actions[np.tile(model.action, cells)]
    one = median_seconds(lambda: rk4_step(system, points, held, model.dt), 25) * grid.size / cells
    return substep_count(system, grid, actions, model.dt) * one


def pendulum_rows(cells: int, dt: float, samples: int) -> list[Row]:
    """Discretisation, soft Bellman backup and violation probabilities of one task."""
    grid, actions = Grid(SYSTEM.space, (cells, cells)), action_grid(SYSTEM, 9)
    what = f"pendulum, {grid.size} cells x 9 actions, dt {dt:g} s, {samples} sample(s)"
    label = f"{grid.size}" + (f"_samples{samples}" if samples > 1 else "")
    model = discretize(SYSTEM, grid, actions, dt, HYPOTHESES, samples)
    distribution = TrajectoryDistribution.of_task(
        model, Task([0.5, 0.0], Box.point([3.0, 0.0]), 5.0)
    )
    distribution.violation_probabilities()  # fills the caches that all tasks share
    return [
        Row(
            f"discretize_{label}",
            median_seconds(lambda: discretize(SYSTEM, grid, actions, dt, HYPOTHESES, samples), 3),
            step_floor(model),
            3,
            f"discretize: {what}; floor: its Runge-Kutta steps",
        ),
        Row(
            f"log_partition_{label}",
            median_seconds(lambda: replace(distribution).log_z),
            exp_floor(distribution),
            7,
            f"soft Bellman backup: {what}; floor: one exponential for each active merged move",
        ),
        Row(
            f"violation_probabilities_{label}",
            median_seconds(distribution.violation_probabilities),
            phi_floor(distribution),
            7,
            f"violation_probabilities: {what}; floor: traffic of Phi",
        ),
    ]


def telescope_rows(settings: Settings, samples: int) -> list[Row]:
    """The telescoping pendulum at the paper's size: five demonstrations, from nothing to ranks."""
    system, grid, dt = settings.model, settings.cells, settings.dt
    actions, hypotheses = action_grid(system, settings.action_counts), settings.candidates
    demonstrations = telescope_demonstrations(settings)
    model = discretize(system, grid, actions, dt, hypotheses, samples)
    tasks = [each.task for each in demonstrations]
    distributions = [TrajectoryDistribution.of_task(model, task) for task in tasks]
    what = (
        f"telescoping pendulum, {grid.size} cells x {len(actions)} actions, {len(hypotheses)} "
        f"hypotheses, {distributions[0].steps} steps, {samples} sample(s)"
    )
    label = "telescope" + (f"_samples{samples}" if samples > 1 else "")
    prepared, paths = prepare(model, tasks), [each.states for each in demonstrations]
    recorded, steps = sum(len(path) for path in paths), [each.times[1] for each in demonstrations]
    return [
        Row(
            f"{label}_discretize",
            median_seconds(lambda: discretize(system, grid, actions, dt, hypotheses, samples), 5),
            step_floor(model),
            5,
            f"discretize: {what}; floor: its Runge-Kutta steps",
        ),
        Row(
            f"{label}_infer_5",
            # A copy is without what earlier tasks have prepared.
            median_seconds(lambda: infer(replace(model), demonstrations).ranking),
            sum(phi_floor(each) + exp_floor(each) for each in distributions),
            7,
            f"5 demonstrations to ranks, the model given: {what}; floor: exponentials and traffic",
            "about 5 minutes on a single CPU core",
        ),
        Row(
            f"{label}_rank_prepared_5",
            median_seconds(lambda: prepared.infer(paths, steps).ranking, 101),
            float("nan"),
            101,
            f"5 demonstrations ({recorded} samples) to ranks, tasks known in advance: {what}",
            "virtually instantaneous",
        ),
        Row(
            f"{label}_rank_prepared_1",
            median_seconds(lambda: prepared.infer(paths[:1], steps[:1], [0]).ranking, 101),
            float("nan"),
            101,
            f"the same for one demonstration: {what}",
            "virtually instantaneous",
        ),
    ]


def telescope_demonstrations(settings: Settings) -> list[Demonstration]:
    """Five unconstrained demonstrations within the bounds."""
    system, box, bounds = settings.model, settings.tasks.box(), settings.model.space.bounds
    trials = sample_trials(
        system,
        None,
        Box(np.maximum(box.lower, bounds.lower), np.minimum(box.upper, bounds.upper)),
        trials=30,
        seed=0,
        horizon=settings.horizon,
        dt=settings.demonstrations.dt,
        goal_offsets=settings.tasks.goal_offsets,
        restarts=1,
    )
    attempts = demonstrate(system, trials, None, None, dt=settings.demonstrations.dt)
    limits = system.control_box
    return [
        attempt.demonstration
        for attempt in attempts
        if attempt.demonstration.controls is not None
        and np.all(limits.contains(attempt.demonstration.controls))
        and np.all(system.space.contains(attempt.demonstration.states))
    ][:5]


def demonstrator_rows() -> list[Row]:
    """Safe set, and 100 tasks x 3 restarts of iLQR with the filter."""
    grid = Grid(SYSTEM.space, (201, 201))
    omega = solve_safe_set(SYSTEM, grid, TRUTH)
    margin = border_margin(SYSTEM, omega, 0.01)
    box = Box(np.array([0.0, -2.0]), np.array([2 * np.pi, 2.0]))
    trials = sample_trials(
        SYSTEM, omega, box, trials=100, seed=0, horizon=5.0, dt=0.01, margin=margin
    )
    safety = SafetyFilter(SYSTEM, omega, 0.01, margin)
    batch = np.zeros((8 * 300, 2)), np.zeros((8 * 300, 1))
    calls = 500 * 10  # eight step sizes of all restarts, at each time step of each iteration
    return [
        Row(
            "safe_set_201x201",
            median_seconds(lambda: solve_safe_set(SYSTEM, grid, TRUTH), 3),
            float("nan"),
            3,
            "safe set of the pendulum, 201 x 201, to convergence",
        ),
        Row(
            "demonstrate_100",
            median_seconds(
                lambda: demonstrate(SYSTEM, trials, TRUTH, safety, dt=0.01, goal_weight=300.0), 1
            ),
            calls * median_seconds(lambda: (SYSTEM.dynamics(*batch), safety.apply(*batch)), 25),
            1,
            "iLQR, 100 tasks x 3 restarts x 10 iterations; floor: its dynamics and filter calls",
        ),
    ]
