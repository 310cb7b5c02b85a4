"""Scores of baselines against every trajectory of a small model, and against distances by hand."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from toy_models import toy_model

from mlci.baselines import BASELINES, crossings, nearest, occupancy, uniform, visits
from mlci.demonstrations import Demonstration, Task
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.spaces import Box
from mlci.tabular import TabularModel

STEPS, CELLS, GOAL = 4, 5, 4


def world() -> TabularModel:
    """Five cells on a line from 0 to 5, three moves of each, and a region for each cell."""
    rng = np.random.default_rng(3)
    successor = rng.integers(0, CELLS, size=(CELLS, 3))
    successor[:, 0] = np.minimum(np.arange(CELLS) + 1, GOAL)  # so that the goal is reached
    crosses = rng.random((CELLS * 3, CELLS)) < 0.2
    shape = successor.shape
    model = toy_model(successor, rng.normal(size=shape), np.ones(shape, bool), crosses)
    boxes = [Box([float(i)], [i + 1.0]) for i in range(CELLS)]
    return replace(model, regions=Regions.from_boxes(model.regions.space, boxes))


def demonstration(states: list[float]) -> Demonstration:
    path = np.array(states)[:, None]
    task = Task(path[0], Box.point([GOAL + 0.5]), float(STEPS))
    return Demonstration(task, path, None, np.linspace(0, STEPS, len(path)))


def every_trajectory(model: TabularModel) -> list[tuple[float, list[int], np.ndarray]]:
    """Probability, cells and crossings of each trajectory from cell 0 to the goal."""
    assert model.kept is not None
    crosses = model.kept.crosses.toarray().reshape(CELLS, 3, CELLS)
    found = []
    for moves in itertools.product(range(3), repeat=STEPS):
        cells, reward, crossed = [0], 0.0, np.zeros(CELLS, dtype=bool)
        for move in moves:
            crossed |= crosses[cells[-1], move]
            reward += model.kept.reward[cells[-1], move]
            cells.append(int(model.kept.successor[cells[-1], move]))
        if cells[-1] == GOAL:
            found.append((float(np.exp(reward)), cells, crossed))
    total = sum(weight for weight, _, _ in found)
    return [(weight / total, cells, crossed) for weight, cells, crossed in found]


def test_visits_are_expected_over_all_trajectories_less_those_of_the_path() -> None:
    model, shown = world(), demonstration([0.5, 0.6, 0.5, 4.2, 4.5])
    expected = np.zeros(CELLS)
    for probability, cells, _ in every_trajectory(model):
        expected += probability * np.bincount(cells, minlength=CELLS)
    distribution = TrajectoryDistribution.of_task(model, shown.task)
    np.testing.assert_allclose(occupancy(distribution), expected, atol=1e-12)
    assert expected.sum() == pytest.approx(STEPS + 1)
    np.testing.assert_allclose(visits(model, [shown])[0], expected - [3, 0, 0, 0, 2], atol=1e-12)


def test_crossings_come_near_to_the_mean_of_phi() -> None:
    model, shown = world(), demonstration([0.5, 1.5, 2.5, 3.5, 4.5])
    phi = np.zeros(CELLS)
    for probability, _, crossed in every_trajectory(model):
        phi += probability * crossed
    share = crossings(model, [shown, shown], 4000, np.random.default_rng(0))
    assert share.shape == (2, CELLS)
    # The mean of 8000 draws is within four standard errors, of .0056 at most.
    assert np.max(np.abs(BASELINES["crossings"].combine(share) - phi)) < 4 * 0.0056
    assert np.ptp(phi) > 0.2


def test_nearest_is_by_distance_and_entered_regions_come_last() -> None:
    model = world()
    paths = [demonstration([0.5, 0.7, 0.2, 0.4, 0.5]), demonstration([2.5, 2.6, 2.25, 2.5, 2.5])]
    # From 0.7 to the cells from 1, 2, 3, 4; from 2.25 down to 2, from 2.6 up to 3.
    np.testing.assert_allclose(nearest(model, paths)[0, 1:], [-0.3, -1.3, -2.3, -3.3])
    scores = BASELINES["nearest"].score(model, paths, 0, np.random.default_rng(0))
    np.testing.assert_allclose(scores, [-np.inf, -0.25, -np.inf, -0.4, -1.4])
    assert np.array_equal(uniform(model, paths), np.zeros((2, CELLS)))


def test_a_task_that_cannot_be_done_says_nothing() -> None:
    model, shown = world(), demonstration([0.5, 0.5])
    assert model.kept is not None
    stuck = replace(model.kept, successor=np.zeros((CELLS, 3), dtype=np.int64))
    model = replace(model, kept=stuck)
    assert not crossings(model, [shown], 10, np.random.default_rng(0)).any()
    assert visits(model, [shown])[0].tolist() == [-STEPS - 1, 0, 0, 0, 0]


def test_nothing_is_scored_by_no_demonstrations_or_no_paths() -> None:
    model, rng = world(), np.random.default_rng(0)
    for baseline in BASELINES.values():
        with pytest.raises(ValueError, match="needs demonstrations, and there are none"):
            baseline.score(model, [], 5, rng)
    with pytest.raises(ValueError, match="1 path of a task or more, not 0"):
        BASELINES["crossings"].score(model, [demonstration([0.5, 4.5])], 0, rng)
