"""Tasks together have the numbers that each has alone."""

from dataclasses import replace

import numpy as np
import pytest

import mlci
from mlci.demonstrations import Task
from mlci.maxent import TrajectoryDistribution
from mlci.spaces import Box
from mlci.tabular import TabularModel
from mlci.task_batches import are_possible, avoidance_of_tasks, batches


@pytest.fixture(scope="module")
def model() -> TabularModel:
    system = mlci.Pendulum()
    regions = mlci.Regions.from_grid(system.space, (5, 7))
    grid = mlci.Grid(system.space, (11, 12))
    return mlci.discretize(system, grid, mlci.action_grid(system, 5), 0.5, regions)


def tasks(model: TabularModel, horizon: float, exact_ends: bool) -> list[TrajectoryDistribution]:
    """Twelve tasks, of which the model can do some, or all if there is time."""
    rng, space = np.random.default_rng(1), model.grid.space
    starts = rng.uniform(space.bounds.lower, space.bounds.upper, size=(12, 2)) * [1, 0.5]
    goals = starts + rng.uniform(-1, 1, size=(12, 2)) * horizon
    return [
        TrajectoryDistribution.of_task(
            model, Task(start, Box(goal - 0.6, goal + 0.6), horizon), exact_ends=exact_ends
        )
        for start, goal in zip(starts, goals, strict=True)
    ]


@pytest.mark.parametrize("exact_ends", [False, True])
@pytest.mark.parametrize("horizon", [0.5, 1.0, 2.5])
def test_batch_has_the_bits_of_its_tasks(
    model: TabularModel, horizon: float, exact_ends: bool
) -> None:
    alone, together = (tasks(model, horizon, exact_ends) for _ in range(2))
    possible = are_possible(together)
    assert possible.tolist() == [each.is_possible for each in alone]
    assert possible.any()
    assert horizon > 2 or not possible.all()
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(other.log_z, one.log_z)
    able = [each for each in together if each.is_possible]
    expected = [each.avoidance_probabilities() for each in alone if each.is_possible]
    np.testing.assert_array_equal(avoidance_of_tasks(able), expected)


def test_batches_are_neighbours_alike_in_order_and_as_many_as_fit(
    monkeypatch: pytest.MonkeyPatch, model: TabularModel
) -> None:
    other = replace(model, temperature=2.0)
    every = [*tasks(model, 2.5, False), *tasks(model, 4.0, False), *tasks(model, 4.0, True)]
    every += tasks(other, 4.0, True)
    split = list(batches(iter(every)))
    assert [len(batch) for batch in split] == [12, 12, 12, 12]
    assert [each for batch in split for each in batch] == every
    fits = 5 * len(model.merged.successor)
    monkeypatch.setattr("mlci.task_batches._MOVES_AT_ONCE", fits)
    assert [len(batch) for batch in batches(every[:12])] == [5, 5, 2]
    monkeypatch.setattr("mlci.task_batches._MOVES_AT_ONCE", 1)
    assert [len(batch) for batch in batches(every[:12])] == [1] * 12
    assert list(batches([])) == []


@pytest.mark.parametrize("exact_ends", [False, True])
def test_regions_block_by_block_have_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, model: TabularModel, exact_ends: bool
) -> None:
    able = [each for each in tasks(model, 2.5, exact_ends) if each.is_possible]
    whole = avoidance_of_tasks(able)
    assert len(np.unique(whole, axis=1).T) > 10
    monkeypatch.setattr("mlci.task_batches.ALPHA_BYTES", 1)  # a region at a time
    np.testing.assert_array_equal(avoidance_of_tasks(able), whole)
