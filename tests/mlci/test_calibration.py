"""Calibration by simulation: its tasks, its halves, and a model whose forecasts are known."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.calibration import (
    FEWEST,
    calibrate,
    calibrate_on,
    certain_by_ends,
)
from mlci.demonstrations import Demonstration, Task, even_times
from mlci.forecasts import fit_map, is_possible
from mlci.grids import Grid
from mlci.preparation import prepare
from mlci.region_sizes import region_sizes
from mlci.regions import Regions
from mlci.similar_tasks import similar_tasks
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, Pendulum
from mlci.tabular import TabularModel, action_grid, discretize


@pytest.fixture(scope="module")
def model() -> TabularModel:
    """A coarse double integrator, with the cells of its positions as regions."""
    system = DoubleIntegrator()
    regions = Regions.from_grid(system.space, (6, 4))
    return discretize(system, Grid(system.space, (12, 8)), action_grid(system, 5), 0.5, regions)


def tasks(count: int, seed: int = 0) -> list[Task]:
    """Random tasks of 3 s between states of the double integrator."""
    ends = np.random.default_rng(seed).uniform([-2, -0.5], [2, 0.5], (count, 2, 2))
    return [Task(start, Box.point(goal), 3.0) for start, goal in ends]


def test_the_map_is_fitted_on_all_and_judged_on_the_second_half(model: TabularModel) -> None:
    rng = np.random.default_rng(2)
    paths = [
        Demonstration(
            task,
            np.linspace(task.start, task.goal.lower, 11) + 0.0,
            None,
            even_times(11, 0.3),
            f"{number}",
        )
        for number, task in enumerate(tasks(50))
    ]
    shuffled = [paths[i] for i in rng.permutation(50)]
    calibration = calibrate_on(model, shuffled, tried=60)
    prepared = prepare(model, [path.task for path in shuffled], exact_ends=True)
    can = prepared.reachable
    half = int(can.sum()) // 2
    alpha, sizes = prepared.avoidance[can], region_sizes(model.regions)
    crossed = np.stack([model.regions.violated_by(path.states) for path in shuffled])[can]
    certain = certain_by_ends(model.regions, prepared.tasks) | prepared.decided_by_cell
    counts = is_possible(alpha) & ~certain[can]
    assert (calibration.tried, calibration.used) == (60, int(can.sum()))
    assert calibration.map == fit_map(alpha, crossed, sizes, counts)
    assert calibration.before is not None
    assert calibration.after is not None
    first = fit_map(alpha[:half], crossed[:half], sizes, counts[:half])
    judged = counts[half:]
    before = ((1 - alpha[half:]) - crossed[half:])[judged] ** 2
    after = ((1 - first.avoidance(alpha[half:], sizes)) - crossed[half:])[judged] ** 2
    assert calibration.before.brier.mean == pytest.approx(before.mean())
    assert calibration.after.brier.mean == pytest.approx(after.mean())
    assert "assuming that people move like the simulated demonstrator" in calibration.summary()


def test_simulated_demonstrations_improve_the_forecasts() -> None:
    """Of the pendulum, whose demonstrator is less sure than the tabular agent."""
    system = Pendulum()
    regions = Regions.from_grid(system.space, (6, 6))
    model = discretize(system, Grid(system.space, (12, 12)), action_grid(system, 5), 0.5, regions)
    ends = np.random.default_rng(0).uniform([0, -2], [6, 2], (8, 2, 2))
    given = [Task(start, Box.point(goal), 5.0) for start, goal in ends]
    calibration = calibrate(model, given, trials=60, restarts=1)
    assert calibration.used > FEWEST
    assert calibration.before is not None
    assert calibration.after is not None
    assert calibration.after.brier.mean < calibration.before.brier.mean
    assert calibration.after.off_by < calibration.before.off_by


def test_demonstrations_stand_for_their_tasks(model: TabularModel) -> None:
    each = tasks(3)
    paths = [
        Demonstration(t, np.linspace(t.start, t.goal.lower, 7), None, even_times(7, 0.5))
        for t in each
    ]
    one, other = (calibrate(model, some, trials=30, restarts=1) for some in (each, paths))
    assert one.map == other.map


def test_tasks_that_the_demonstrator_cannot_do_leave_no_map(model: TabularModel) -> None:
    hopeless = [Task(np.array([-2.9, 0.0]), Box.point([2.9, 0.0]), 0.5)]
    calibration = calibrate(model, hopeless, trials=30, restarts=1)
    assert calibration.map is None
    assert calibration.used < FEWEST
    assert "of 30 tasks like these" in calibration.summary()


def test_what_is_certain_by_the_ends() -> None:
    space = Pendulum().space
    low, high = space.bounds.lower[0], space.bounds.upper[0]
    regions = Regions.from_boxes(
        space,
        [
            Box([low, -6.0], [low + 1.0, 0.0]),
            Box([high - 1.0, -6.0], [high, 6.0]),
            Box([high - 1.0, -1.0], [high, 1.0]),
        ],
    )
    start, free = np.array([low + 0.5, -1.0]), [np.inf]
    point = Task(start, Box.point([high - 0.5, 0.0]), 1.0)
    any_speed = Task(
        start, Box(np.array([high - 0.6, -np.inf]), np.array([high - 0.5, *free])), 1.0
    )
    on_edge = Task(np.array([low + 1.0, -1.0]), Box.point([0.0, 5.0]), 1.0)
    certain = certain_by_ends(regions, [point, any_speed, on_edge])
    assert certain.tolist() == [[True, True, True], [True, False, False], [False, False, False]]


def test_similar_tasks_are_spread_like_the_given_ones() -> None:
    """In the limit of many: Scott's rule adds a variance of N^(-2 / (n + 4)) of theirs."""
    space = StateSpace(Box([-100.0, 0.0], [100.0, 1.0]), [False, True], ("x", "angle"))
    rng = np.random.default_rng(0)
    given = [
        Task(np.array([x, (0.95 + a) % 1]), Box([x - 1, -np.inf], [x + 3, np.inf]), 2.0 + (x > 0))
        for x, a in zip(rng.normal(0, 5, 60), rng.normal(0, 0.03, 60), strict=True)
    ]
    similar = similar_tasks(space, given, 4000, rng)
    widening = np.sqrt(1 + 60 ** (-2 / 6))
    starts, goals = (np.array([of(task) for task in similar]) for of in (_start, _goal))
    before = np.array([_start(task) for task in given]), np.array([_goal(task) for task in given])
    assert np.std(starts[:, 0]) == pytest.approx(widening * np.std(before[0][:, 0]), rel=0.05)
    assert np.std(goals) == pytest.approx(widening * np.std(before[1]), rel=0.05)
    angle = space.difference(starts, np.array([0.0, 0.95]))[:, 1]
    expected = widening * np.std(space.difference(before[0], np.array([0.0, 0.95]))[:, 1])
    assert np.std(angle) == pytest.approx(expected, rel=0.05)
    assert {task.horizon for task in similar} == {2.0, 3.0}
    assert all(np.isinf(task.goal.upper[1]) for task in similar)


def _start(task: Task) -> np.ndarray:
    return task.start


def _goal(task: Task) -> float:
    return float(task.goal.lower[0])


def test_similar_tasks_stay_in_the_space_and_one_task_is_copied() -> None:
    space = DoubleIntegrator().space
    edge = [Task(np.array([x, 0.0]), Box.point([2.99, v]), 1.0) for x, v in [(2.9, 2), (-2.9, -2)]]
    rng = np.random.default_rng(0)
    for task in similar_tasks(space, edge, 200, rng):
        assert np.all(space.contains(np.stack([task.start, task.goal.lower])))
    copies = similar_tasks(space, edge[:1], 3, rng)
    assert all(np.array_equal(task.start, edge[0].start) for task in copies)
    with pytest.raises(ValueError, match="at least one task"):
        similar_tasks(space, [], 3, rng)
