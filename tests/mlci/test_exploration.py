"""Exploration: what a task is told by the cells that it can come by, and by the whole model."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.demonstrations import Task
from mlci.exploration import explore
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.simulate import rollout
from mlci.spaces import Box, StateSpace
from mlci.systems import FunctionSystem, Pendulum
from mlci.tabular import TabularModel, action_grid, discretize
from tests.benchmark.two_link_arm import TwoLinkArm

SYSTEM = Pendulum()
REGIONS = Regions.from_grid(SYSTEM.space, (6, 5))
WORLD = SYSTEM, Grid(SYSTEM.space, (13, 12)), action_grid(SYSTEM, 3), 0.4, REGIONS, 2
MODEL = TabularModel(*WORLD)
TASKS = [
    Task([0.4, -1.0], Box.point([1.7, 0.5]), 2.0),
    Task([3.0, 0.0], Box.point([3.3, 0.6]), 0.8),
]


def assert_same(one: TabularModel, other: TabularModel, task: Task, exact_ends: bool) -> None:
    """To the last bit, log Z of all cells and alpha of all regions."""
    ways = [
        TrajectoryDistribution.of_task(model, task, exact_ends=exact_ends) for model in (one, other)
    ]
    np.testing.assert_array_equal(*(way.log_z for way in ways))
    assert ways[0].is_possible
    np.testing.assert_array_equal(*(way.avoidance_probabilities() for way in ways))


@pytest.mark.parametrize("exact_ends", [False, True])
@pytest.mark.parametrize("truth", [None, np.arange(30) == 13])
@pytest.mark.parametrize(("temperature", "bounded"), [(1.0, True), (0.5, True), (1.0, False)])
def test_each_task_is_that_of_the_whole_model(exact_ends, truth, temperature, bounded):
    progress: list[int] = []
    explored = explore(
        MODEL, TASKS, exact_ends=exact_ends, bounded=bounded, progress=progress.append
    )
    known = explored.explored.cells
    assert 20 < known.sum() < MODEL.states - 20
    assert progress[-1] == known.sum()
    assert np.all(np.diff(explored.merged.begins)[~known] == 0)
    whole = discretize(*WORLD).with_temperature(temperature)
    explored = explored.with_temperature(temperature)
    if truth is not None:
        whole, explored = whole.under(truth), explored.under(truth)
    for task in TASKS:
        assert_same(whole, explored, task, exact_ends)


def test_processes_find_the_same() -> None:
    one, two = (explore(MODEL, TASKS, n_jobs=n_jobs) for n_jobs in (1, 2))
    np.testing.assert_array_equal(one.explored.cells, two.explored.cells)
    for name in vars(one.merged):
        np.testing.assert_array_equal(getattr(one.merged, name), getattr(two.merged, name))


@pytest.mark.parametrize("exact_ends", [False, True])
def test_another_task_is_refused(exact_ends: bool) -> None:
    """It would seem impossible, or improbable, for want of moves."""
    explored = explore(MODEL, TASKS[1:], exact_ends=exact_ends)
    with pytest.raises(ValueError, match=r"for other tasks than that from cell \d+ in 5 steps"):
        _ = TrajectoryDistribution.of_task(explored, TASKS[0], exact_ends=exact_ends).reachable


def test_cells_too_far_from_the_goal_are_passed_over() -> None:
    every, near = (
        explore(MODEL, TASKS, bounded=bounded).explored.cells for bounded in (False, True)
    )
    assert np.all(every[near])
    assert near.sum() < every.sum()


@pytest.mark.parametrize("strength", [3.0, -3.0])
def test_dynamics_that_change_too_much_within_a_cell_are_told(strength: float) -> None:
    """A gust between the centres of cells, which no bound from the centres can know of."""

    def rates(x, u):
        gust = np.where(np.abs((x[..., 0] % 1.0) - 0.25) < 0.1, strength, 0.0)
        return (0.1 * u[..., 0] + gust,)

    space = StateSpace(Box([0.0], [20.0]), [False], ("place",))
    line = FunctionSystem(rates, space, Box([-1.0], [1.0]))
    regions = Regions.from_grid(space, (4,))
    model = TabularModel(line, Grid(space, (20,)), np.array([[-1.0], [1.0]]), 0.9, regions, 2)
    task = Task([3.4], Box([2.0], [8.0]), 1.8)
    with pytest.raises(ValueError, match=r"moves of cell \d+ lead further than those from"):
        explore(model, [task])
    assert explore(model, [task], bounded=False).explored.cells.sum() > 1


def test_one_step_between_states() -> None:
    task = Task([3.0, 0.0], Box([2.0, -2.0], [4.0, 2.0]), 0.4)
    explored = explore(MODEL, [task])
    assert TrajectoryDistribution.of_task(explored, task).is_possible
    assert_same(discretize(*WORLD), explored, task, exact_ends=True)


def test_an_arm_of_six_dimensions_is_explored_as_a_whole_is() -> None:
    arm = TwoLinkArm()
    grid = Grid(arm.space, (5, 4, 4, 3, 4, 3))
    regions = Regions.from_grid(arm.space, (4, 4, None, None, None, None))
    world = arm, grid, action_grid(arm, (3, 2)), 0.2, regions, 2
    start = np.array([0.1, 0.8, 0.8, 0.5, -0.1, -0.1])
    end = rollout(arm, start, np.zeros((4, 2)), 0.2)[-1]
    task = Task(start, Box(end - 0.3, end + 0.3), 0.8)
    explored = explore(TabularModel(*world), [task])
    assert explored.explored.cells.sum() < 0.8 * grid.size
    assert_same(discretize(*world), explored, task, exact_ends=True)
