"""Trajectories that begin and end at states, against a list of all of them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mlci.demonstrations import Task
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.simulate import rollout
from mlci.spaces import Bools, Box, Floats, StateSpace
from mlci.systems import FunctionSystem
from mlci.tabular import TabularModel, discretize

# A floor of 4 x 3 tiles on which one steps to a neighbour, or stays, in 1 s; a wind blows along x
# that makes the way there and back differ. Regions are smaller than tiles.
SPACE = StateSpace(Box([0.0, 0.0], [4.0, 3.0]), [False, False], ("x", "y"))
FLOOR = FunctionSystem(
    lambda x, u: (u[..., 0] + 0.2 * np.sin(2 * x[..., 1]), u[..., 1]), SPACE, Box([-1, -1], [1, 1])
)
STEPS = np.array(list(itertools.product([-1.0, 0.0, 1.0], repeat=2)))
REGIONS = Regions.from_grid(SPACE, (7, 7))  # whose edges no motion follows
GRID = Grid(SPACE, (4, 3))
TASKS = [
    Task([0.9, 1.2], Box.point([3.1, 1.9]), 3.0),
    Task([0.2, 0.1], Box([1.6, -np.inf], [1.9, np.inf]), 2.0),
    Task([1.8, 1.5], Box.point([2.3, 2.2]), 1.0),
]


@pytest.fixture(scope="module")
def model() -> TabularModel:
    return discretize(FLOOR, GRID, STEPS, 1.0, REGIONS, temperature=2.0)


def trajectories(model: TabularModel, task: Task) -> tuple[Floats, Bools]:
    """Weights, and which regions are crossed, of all sequences of steps that do a task."""
    count, cells = round(task.horizon), GRID.cells_in(task.goal)
    weights, crossings = list[float](), list[Bools]()
    for sequence in itertools.product(STEPS, repeat=count):
        state, crossed = task.start, np.zeros(len(REGIONS), dtype=bool)
        for k, step in enumerate(sequence):
            path = rollout(FLOOR, state, step[None], 1.0, model.substeps)
            cell = int(GRID.index(path[-1]))
            if k == count - 1 and cell in cells:
                bend = SPACE.excess(path[-1], task.goal)
                path = path - np.linspace(0, 1, len(path))[:, None] * bend
            if not np.all(SPACE.contains(path)):
                break
            crossed |= REGIONS.violated_by(path)
            state = GRID.centers[cell]
        else:
            if cell in cells:
                weights.append(np.exp(-np.sum(np.square(sequence)) / 2.0))
                crossings.append(crossed)
    return np.array(weights), np.array(crossings)


@pytest.fixture(scope="module")
def of_tasks(model: TabularModel) -> list[tuple[Floats, Bools]]:
    """The trajectories of each of the tasks."""
    return [trajectories(model, task) for task in TASKS]


def listed(of_task: tuple[Floats, Bools], truth: Bools) -> tuple[float, Floats]:
    """Z, and for each region the part of Z that avoids it, of trajectories without a truth."""
    weights, crossed = of_task
    weights = weights * ~crossed[:, truth].any(axis=1)
    return float(np.sum(weights)), weights @ ~crossed


@pytest.mark.parametrize("number", [0, 1, 2], ids=["three steps", "two steps", "one step"])
@pytest.mark.parametrize("forbidden", [[], ["16"]], ids=["free", "under a truth"])
def test_exact_ends_are_those_of_all_trajectories(
    model: TabularModel, of_tasks: list[tuple[Floats, Bools]], number: int, forbidden: list[str]
) -> None:
    task, truth = TASKS[number], REGIONS.mask(forbidden)
    total, avoiding = listed(of_tasks[number], truth)
    distribution = TrajectoryDistribution.of_task(model.under(truth), task, exact_ends=True)
    assert distribution.log_z[0, distribution.start] == pytest.approx(np.log(total), abs=1e-12)
    alpha = distribution.avoidance_probabilities()
    np.testing.assert_allclose(alpha, avoiding / total, rtol=0, atol=1e-12)
    np.testing.assert_allclose(alpha[truth], 1, atol=1e-12)
    between = TrajectoryDistribution.of_task(model.under(truth), task).avoidance_probabilities()
    assert np.max(np.abs(alpha - between)) > 0.1


@pytest.mark.parametrize("number", [1, 2], ids=["two steps", "one step"])
def test_a_truth_forbids_what_enters_it_as_it_is_bent(
    model: TabularModel, of_tasks: list[tuple[Floats, Bools]], number: int
) -> None:
    """Every region in turn: also those that a last move enters only before it is bent."""
    bent_aside = 0
    for i in range(len(REGIONS)):
        truth = np.arange(len(REGIONS)) == i
        total, _ = listed(of_tasks[number], truth)
        under = model.under(truth)
        distribution = TrajectoryDistribution.of_task(under, TASKS[number], exact_ends=True)
        assert distribution.is_possible == (total > 0)
        if total:
            log_z = distribution.log_z[0, distribution.start]
            assert log_z == pytest.approx(np.log(total), abs=1e-12)
        into = np.isin(model.kept.successor, distribution.goal)
        bent_aside += np.sum(into & ~under.kept.allowed(under.truth))
    assert bent_aside > 10


def test_a_region_round_the_centre_of_the_start_cell_can_be_avoided() -> None:
    """As the demonstration does, which begins beside it."""
    pillar = Regions.from_boxes(SPACE, [Box([0.4, 1.4], [0.6, 1.6])])
    model = discretize(FLOOR, GRID, STEPS, 1.0, pillar)
    task = Task([0.9, 1.1], Box.point([3.5, 1.5]), 3.0)
    cells, exact = (
        TrajectoryDistribution.of_task(model, task, exact_ends=ends) for ends in (False, True)
    )
    assert cells.avoidance_probabilities()[0] == 0
    assert exact.avoidance_probabilities()[0] > 0.9


def test_ends_that_cannot_be_joined_are_impossible_not_nan(model: TabularModel) -> None:
    far = Task([0.5, 0.5], Box.point([3.9, 2.9]), 2.0)
    distribution = TrajectoryDistribution.of_task(model, far, exact_ends=True)
    assert not distribution.is_possible
    assert not np.any(np.isnan(distribution.log_z))
    near = TrajectoryDistribution.of_task(model, TASKS[0], exact_ends=True)
    with pytest.raises(ValueError, match="sampled between cells: take exact_ends=False"):
        near.sample(1, np.random.default_rng(0))
