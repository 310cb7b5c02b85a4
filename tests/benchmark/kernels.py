"""Times of what people wait for, at the paper's sizes: from a system to a ranking."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from experiments.config.settings import Settings
from mlci.demonstrations import Demonstration, Task
from mlci.demonstrator import demonstrate, sample_trials
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.preparation import infer, prepare
from mlci.regions import Regions
from mlci.safety.reachability import solve_safe_set
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.spaces import Box
from mlci.systems import Pendulum
from mlci.tabular import TabularModel, action_grid, discretize
from tests.benchmark.timing import Row, median_seconds

SYSTEM = Pendulum()
HYPOTHESES = Regions.from_grid(SYSTEM.space, (10, 10))
TRUTH = Regions(SYSTEM.space, [[np.pi, 0.0]], [[1.2 * np.pi, 1.2]])  # type: ignore[arg-type]


def pendulum_rows(cells: int, samples: int) -> list[Row]:
    """Discretisation, and log Z and Phi of one task."""
    grid, actions = Grid(SYSTEM.space, (cells, cells)), action_grid(SYSTEM, 9)
    what = f"pendulum, {grid.size} cells x 9 actions, {samples} sample(s)"
    label = f"{grid.size}" + (f"_samples{samples}" if samples > 1 else "")
    model = discretize(SYSTEM, grid, actions, 0.25, HYPOTHESES, samples)
    task = Task([0.5, 0.0], Box.point([3.0, 0.0]), 5.0)  # type: ignore[arg-type]
    return [
        _row(
            f"discretize_{label}",
            lambda: discretize(SYSTEM, grid, actions, 0.25, HYPOTHESES, samples),
            3,
            f"discretize: {what}",
        ),
        _row(
            f"violation_probabilities_{label}",
            lambda: TrajectoryDistribution.of_task(model, task).violation_probabilities(),
            7,
            f"log Z and Phi of one task: {what}",
        ),
    ]


def telescope_rows(settings: Settings, samples: int) -> list[Row]:
    """The telescoping pendulum at the paper's size: five demonstrations, from nothing to ranks."""
    system, grid, dt = settings.model, settings.cells, settings.dt
    actions, hypotheses = action_grid(system, settings.action_counts), settings.candidates
    demonstrations = telescope_demonstrations(settings)

    def form() -> TabularModel:
        return discretize(system, grid, actions, dt, hypotheses, samples)

    model = form()
    what = (
        f"telescoping pendulum, {grid.size} cells x {len(actions)} actions, {len(hypotheses)} "
        f"hypotheses, {samples} sample(s)"
    )
    label = "telescope" + (f"_samples{samples}" if samples > 1 else "")
    prepared = prepare(model, [each.task for each in demonstrations])
    paths, steps = (
        [each.states for each in demonstrations],
        [each.times[1] for each in demonstrations],
    )
    recorded = sum(len(path) for path in paths)
    return [
        _row(f"{label}_discretize", form, 5, f"discretize: {what}"),
        _row(
            f"{label}_rank_5",
            lambda: infer(form(), demonstrations).ranking,
            5,
            f"from the system and 5 demonstrations to ranks: {what}",
            "about 5 minutes on a single CPU core",
        ),
        _row(
            f"{label}_rank_prepared_5",
            lambda: prepared.infer(paths, steps).ranking,
            101,
            f"5 demonstrations ({recorded} samples) to ranks, tasks known in advance: {what}",
            "virtually instantaneous",
        ),
        _row(
            f"{label}_rank_prepared_1",
            lambda: prepared.infer(paths[:1], steps[:1], [0]).ranking,
            101,
            f"the same for one demonstration: {what}",
            "virtually instantaneous",
        ),
    ]


def _row(name: str, work: Callable[[], object], runs: int, what: str, paper: str = "") -> Row:
    """What was timed, without a floor."""
    return Row(name, median_seconds(work, runs), float("nan"), runs, what, paper)


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
    return [
        _row(
            "safe_set_201x201",
            lambda: solve_safe_set(SYSTEM, grid, TRUTH),
            3,
            "safe set of the pendulum, 201 x 201, to convergence",
        ),
        _row(
            "demonstrate_100",
            lambda: demonstrate(SYSTEM, trials, TRUTH, safety, dt=0.01, goal_weight=300.0),
            1,
            "iLQR behind the safety filter, 100 tasks x 3 restarts x 10 iterations",
        ),
    ]
