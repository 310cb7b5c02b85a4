"""What is known before anybody demonstrates, against loops over tasks and regions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlci.demonstrator import demonstrate, sample_trials
from mlci.diagnosis import Diagnosis, diagnose
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.outlook.outlook import FEATURES, Outlook, outlook
from mlci.regions import Regions
from mlci.spaces import Box
from mlci.systems import DoubleIntegrator
from mlci.tabular import action_grid, discretize

SYSTEM = DoubleIntegrator()
REGIONS = Regions.from_grid(SYSTEM.space, (6, 3))


@pytest.fixture(scope="module")
def paths() -> list:
    box = Box([-2.0, -0.5], [2.0, 0.5])
    trials = sample_trials(SYSTEM, None, box, trials=6, seed=0, horizon=4.0, dt=0.1, restarts=1)
    return [it.demonstration for it in demonstrate(SYSTEM, trials, None, None, dt=0.1)]


@pytest.fixture(scope="module")
def model():
    return discretize(SYSTEM, Grid(SYSTEM.space, (10, 10)), action_grid(SYSTEM, 5), 0.5, REGIONS)


def test_each_number_is_that_of_a_loop(model, paths) -> None:
    known = outlook(model, paths)
    phi = np.zeros((6, len(REGIONS)))
    for j, path in enumerate(paths):
        distribution = TrajectoryDistribution.of_task(model, path.task)
        assert known.reachable[j] == distribution.is_possible
        if distribution.is_possible:
            phi[j] = distribution.violation_probabilities()
    entered = np.array(
        [
            [REGIONS.select(np.arange(18) == i).violated_by(p.states)[0] for i in range(18)]
            for p in paths
        ]
    )
    assert known.reachable.any()
    features = dict(zip(FEATURES, known.features(4).T, strict=True))
    np.testing.assert_allclose(features["touched"], entered.mean(axis=0))
    np.testing.assert_allclose(np.exp(features["expected_violations"]), 0.1 + 4 * phi.mean(axis=0))
    diagnosis = diagnose(model)
    assert set(features["frozen"]) == {max(diagnosis.frozen)}
    np.testing.assert_allclose(np.exp(features["cells_crossed"]), diagnosis.cells_crossed)
    assert set(features["unreachable"]) == {np.mean(~known.reachable)}
    off = np.abs(phi - entered).sum(axis=1)[known.reachable].mean()
    np.testing.assert_allclose(features["forecast_error"], off / entered.sum(axis=1).mean())
    evidence = np.mean(-np.log(0.1 + 0.9 * (1 - phi)), axis=0)
    for i in range(18):
        rivals = 0.0
        for k in range(18):
            if k != i and evidence[k] >= evidence[i]:
                telling = sum(entered[j, k] and not entered[j, i] for j in range(6)) / 6
                rivals += (1 - telling) ** 4
        assert features["rivals"][i] == pytest.approx(np.log(1 + rivals), abs=1e-12)


def test_forecasts_of_tasks_out_of_reach_are_no_errors() -> None:
    entered = np.array([[1, 0, 0], [1, 1, 0], [0, 1, 1]], dtype=bool)
    phi = np.array([[0.9, 0.1, 0.0], [0.8, 0.7, 0.0], [0.0, 0.0, 0.0]])
    known = Outlook(
        *(Diagnosis(0.0, 0.0, 2.0, (0.1, 0.2)), np.array([1.5, 0.8]), 0.5),
        *(np.array([True, True, False]), entered, phi),
    )
    assert known.forecast_error == pytest.approx((0.2 + 0.5) / 2 / (5 / 3))
    nobody = replace(known, reachable=np.zeros(3, dtype=bool))
    assert nobody.forecast_error == 1
    assert known.features(2)[0, FEATURES.index("reach")] == np.log(0.8 + 0.01)  # the least
    # Of the second region's rivals the first is entered without it by a third of the tasks.
    assert known.rivals(2)[1] == pytest.approx((1 - 1 / 3) ** 2)


def test_a_mask_takes_the_hypotheses_alone(model, paths) -> None:
    mask = np.arange(18) % 3 == 1
    some, all_of_them = outlook(model, paths, mask), outlook(model, paths)
    np.testing.assert_array_equal(some.touched, all_of_them.touched[mask])
    np.testing.assert_array_equal(some.crossed, all_of_them.crossed[mask])


def test_no_path_is_refused(model) -> None:
    with pytest.raises(ValueError, match="an outlook needs the optimal path of a task at least"):
        outlook(model, [])
