"""Ranking with what was prepared, against everything computed at once from the demonstrations."""

from __future__ import annotations

import time

import numpy as np
import pytest

from mlci.grids import Grid
from mlci.inference import Ranking, rank_constraints
from mlci.maxent import log_partition, violation_probabilities
from mlci.online import PreparedInference, prepare
from mlci.regions import ConstraintSet
from mlci.simulate import rollout
from mlci.spaces import Floats
from mlci.systems import DoubleIntegrator
from mlci.tabular import TabularMDP, action_grid, discretize

SYSTEM = DoubleIntegrator()
GRID = Grid(SYSTEM.space, (12, 10))
HYPOTHESES = ConstraintSet.from_grid(SYSTEM.space, (10, 10))
# The last goal is further than the bounds allow to go in the time.
STARTS = [[-1.0, 0.0], [2.0, 0.5], [0.0, -1.0], [-2.9, 0.0]]
ENDS = [[1.0, 0.0], [-1.0, 0.0], [1.5, 0.5], [2.9, 0.0]]
STEPS = [10, 10, 8, 2]


@pytest.fixture(scope="module")
def mdp() -> TabularMDP:
    return discretize(SYSTEM, GRID, action_grid(SYSTEM, 5), 0.5, HYPOTHESES)


@pytest.fixture(scope="module")
def prepared(mdp: TabularMDP) -> PreparedInference:
    starts = [int(cell) for cell in GRID.index(STARTS)]
    return prepare(mdp, HYPOTHESES, starts, [[int(GRID.index(end))] for end in ENDS], STEPS)


def shown(task: int, seed: int) -> Floats:
    """A path of 501 samples from near the start of a task, with random controls."""
    rng = np.random.default_rng([task, seed])
    start = np.array(STARTS[task]) + rng.normal(scale=0.1, size=2)
    return rollout(SYSTEM, start, rng.uniform(-0.6, 0.6, (500, 1)), 0.01)


@pytest.mark.parametrize("last", [501, 300])
def test_ranking_online_is_ranking_at_once(
    mdp: TabularMDP, prepared: PreparedInference, last: int
) -> None:
    """Tasks shown twice, never, one whose goal cannot be reached; paths of one length or not."""
    tasks = [2, 0, 2, 3]
    paths = [shown(task, seed) for seed, task in enumerate(tasks)]
    paths[-1] = paths[-1][:last]
    assert prepared.reachable.tolist() == [True, True, True, False]
    phi = []
    for task in (2, 0, 2):
        start = int(GRID.index(STARTS[task]))
        log_z = log_partition(mdp, start, [int(GRID.index(ENDS[task]))], STEPS[task])
        phi.append(violation_probabilities(mdp, log_z, start))
    violated = [HYPOTHESES.violated_by(path) for path in paths]
    expected = rank_constraints(phi, violated, 0.3)
    assert 10 < np.sum(expected.feasible) < 100
    assert np.ptp(expected.gain[expected.feasible]) > 0.1
    assert_same(prepared.rank(paths, tasks, 0.3), expected)


def assert_same(one: Ranking, other: Ranking) -> None:
    for name in ("gain", "feasible", "rank", "order", "posterior", "posterior_none"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_each_task_once_is_the_default(prepared: PreparedInference) -> None:
    paths = [shown(task, 0) for task in range(4)]
    assert_same(prepared.rank(paths), prepared.rank(paths, [0, 1, 2, 3]))


def test_a_demonstration_at_a_time_takes_under_a_millisecond(prepared: PreparedInference) -> None:
    """Violations of 501 samples and the ranking of 100 hypotheses; the best of many runs."""
    path, times = [shown(1, 0)], []
    for _ in range(50):
        start = time.perf_counter()
        prepared.rank(path, [1])
        times.append(time.perf_counter() - start)
    assert min(times) < 1e-3


def test_wrong_tasks_are_refused(mdp: TabularMDP, prepared: PreparedInference) -> None:
    path = shown(0, 0)
    with pytest.raises(ValueError, match=r"2 paths need as many tasks, not \[1\]"):
        prepared.rank([path, path], [1])
    with pytest.raises(ValueError, match=r"1 paths need as many tasks, not \[0, 1, 2, 3\]"):
        prepared.rank([path])
    with pytest.raises(ValueError, match=r"numbered 0 to 3, not \[4\]"):
        prepared.rank([path], [4])
    with pytest.raises(ValueError, match=r"numbered 0 to 3, not \[-1\]"):
        prepared.rank([path], [-1])
    fewer = ConstraintSet.from_grid(SYSTEM.space, (5, 5))
    with pytest.raises(ValueError, match="made with 100 regions, not these 25"):
        prepare(mdp, fewer, [0], [[0]], [1])
    with pytest.raises(ValueError, match=r"phi \(4, 100\) does not fit 4 tasks and 25 hypotheses"):
        PreparedInference(fewer, prepared.phi, prepared.reachable)
