"""What is known before anybody demonstrates, against loops over tasks and regions."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from mlci.demonstrations import Demonstration, Task, even_times
from mlci.demonstrator import demonstrate, sample_trials
from mlci.diagnosis import Diagnosis, diagnose
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.outlook.detours import tabular_detours
from mlci.outlook.flow import control_reach, flow_expansion
from mlci.outlook.outlook import FEATURES, Outlook, outlook
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, FunctionSystem
from mlci.tabular import action_grid, discretize

SYSTEM = DoubleIntegrator()
REGIONS = Regions.from_grid(SYSTEM.space, (6, 3))
KNOWN = Outlook(
    diagnosis=Diagnosis(0.0, 0.0, 2.0, (0.1, 0.2)),
    reach=np.array([1.5, 0.8]),
    expansion=0.5,
    reachable=np.ones(4, dtype=bool),
    entered=np.array([[0, 1, 0], [1, 0, 0], [0, 0, 0], [1, 0, 0]], dtype=bool),
    ends=np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 0, 0]], dtype=bool),
    phi=np.array([[0.2, 0.4, 0.1], [0.7, 0.85, 0.3], [0.3, 0.0, 0.6], [1.0, 0.0, 0.0]]),
    detours=lambda truth, tasks: np.zeros((len(tasks), 3), dtype=bool),
)


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
        distribution = TrajectoryDistribution.of_task(model, path.task, exact_ends=True)
        between_cells = TrajectoryDistribution.of_task(model, path.task)
        assert known.reachable[j] == between_cells.is_possible
        if distribution.is_possible:
            phi[j] = distribution.violation_probabilities()
    entered = np.array(
        [
            [REGIONS.select(np.arange(18) == i).violated_by(p.states)[0] for i in range(18)]
            for p in paths
        ]
    )
    assert known.reachable.any()
    features = dict(zip(FEATURES, known.features(np.arange(18), 4, 3).T, strict=True))
    np.testing.assert_allclose(features["touched"], entered.mean(axis=0))
    np.testing.assert_allclose(np.exp(features["expected_violations"]), 0.1 + 4 * phi.mean(axis=0))
    diagnosis = diagnose(model)
    assert set(features["frozen"]) == {max(diagnosis.frozen)}
    np.testing.assert_allclose(np.exp(features["cells_crossed"]), diagnosis.cells_crossed)
    reach = control_reach(SYSTEM, model.grid, SYSTEM.control_box, 0.5)
    np.testing.assert_allclose(features["reach"], np.log(reach.min() + 0.01))
    stretched = np.mean([flow_expansion(SYSTEM, path) for path in paths])
    np.testing.assert_allclose(features["expansion"], stretched)
    held = [[REGIONS.box(i).contains(p.states[[0, -1]]).any() for i in range(18)] for p in paths]
    np.testing.assert_array_equal(known.ends, held)
    assert set(features["unreachable"]) == {np.mean(~known.reachable)}
    off = np.abs(phi - entered).sum(axis=1)[known.reachable].mean()
    np.testing.assert_allclose(features["forecast_error"], off / entered.sum(axis=1).mean())


def test_a_simulated_study_is_ranked_as_demonstrations_would_be() -> None:
    """All ways to draw two of three tasks, by loops; the fourth task begins in the truth."""
    known = replace(KNOWN, detours=lambda truth, tasks: np.array([[0, 1, 0]] * len(tasks)) > 0)
    crossed = [[0, 1, 0], [0, 1, 0], [0, 0, 0]]  # the second task has to go round the first region
    succeeded = []
    for pair in itertools.product(range(3), repeat=2):
        gain = np.zeros(3)
        for task in pair:
            for region in range(3):
                seen = -np.log(0.1 + 0.9 * (1 - known.phi[task, region]))
                gain[region] += -np.inf if crossed[task][region] else seen
        succeeded.append(gain[0] >= max(gain[1:]))
    share = np.mean(succeeded)
    assert 0.3 < share < 0.9
    error = 2 * np.sqrt(share * (1 - share) / 200)
    assert known.simulated_success(0, 2, 1) == pytest.approx(share, abs=error)
    assert known.simulated_success(0, 2, 3) == 1
    assert replace(known, ends=np.ones((4, 3), dtype=bool)).simulated_success(0, 2, 3) == 0


def test_a_detour_is_the_best_tabular_way_that_avoids_the_region(model, paths) -> None:
    every = np.ones(len(REGIONS), dtype=bool)
    tasks = [path.task for path in paths]
    detours = tabular_detours(model, tasks, every)
    phi = outlook(model, paths).phi
    task, region = np.argwhere((phi > 0.3) & (phi < 0.9))[0].tolist()
    (crossed,) = detours(region, np.array([task]))
    assert not crossed[region]
    assert crossed.any()
    under = model.under(np.arange(len(REGIONS)) == region)
    distribution = TrajectoryDistribution.of_task(under, tasks[task])
    cells, moves = distribution.sample(3000, np.random.default_rng(1))
    rewards = model.policy_moves(np.arange(model.states))[1][cells[:, :-1], moves].sum(axis=1)
    best = np.argmax(rewards)
    ways = model.crossed(cells[[best], :-1], moves[[best]])[0]
    assert np.mean(ways == crossed) > 0.8
    some = tabular_detours(model, tasks, np.arange(18) != (region + 1) % 18)
    assert some(region - (region == 17), np.array([task])).shape == (1, 17)


def test_forecasts_of_tasks_out_of_reach_are_no_errors() -> None:
    entered = np.array([[1, 0, 0], [1, 1, 0], [0, 1, 1]], dtype=bool)
    phi = np.array([[0.9, 0.1, 0.0], [0.8, 0.7, 0.0], [0.0, 0.0, 0.0]])
    ends = np.zeros((3, 3), dtype=bool)
    known = Outlook(
        *(Diagnosis(0.0, 0.0, 2.0, (0.1, 0.2)), np.array([1.5, 0.8]), 0.5),
        *(np.array([True, True, False]), entered, ends, phi, KNOWN.detours),
    )
    assert known.forecast_error == pytest.approx((0.2 + 0.5) / 2 / (5 / 3))
    nobody = replace(known, reachable=np.zeros(3, dtype=bool))
    assert nobody.forecast_error == 1
    assert known.features([0], 2, 1)[0, FEATURES.index("reach")] == np.log(0.8 + 0.01)  # the least


def test_a_mask_takes_the_hypotheses_alone(model, paths) -> None:
    mask = np.arange(18) % 3 == 1
    some, all_of_them = outlook(model, paths, mask), outlook(model, paths)
    np.testing.assert_array_equal(some.touched, all_of_them.touched[mask])
    np.testing.assert_array_equal(some.crossed, all_of_them.crossed[mask])


def test_what_only_a_cell_decides_counts_for_nothing() -> None:
    """The pillar holds the centre of the first cell, but not the start."""
    floor = StateSpace(Box([0.0, 0.0], [4.0, 3.0]), [False, False], ("x", "y"))
    walker = FunctionSystem(lambda x, u: (u[..., 0], u[..., 1]), floor, Box([-1, -1], [1, 1]))
    pillars = Regions.from_boxes(floor, [Box([0.4, 1.4], [1.3, 1.6]), Box([1.4, 0.0], [1.6, 3.0])])
    model = discretize(walker, Grid(floor, (4, 3)), action_grid(walker, 3), 1.0, pillars)
    states = np.linspace([0.9, 1.1], [3.5, 1.5], 31)
    task = Task(states[0], Box.point(states[-1]), 3.0)
    controls = np.diff(states, axis=0) / 0.1
    path = Demonstration(task, states, controls, even_times(31, 0.1))
    between_states = TrajectoryDistribution.of_task(model, task, exact_ends=True)
    assert 0.1 < between_states.violation_probabilities()[0] < 0.9
    assert TrajectoryDistribution.of_task(model, task).violation_probabilities()[0] > 0.999
    np.testing.assert_allclose(outlook(model, [path]).phi, [[0.0, 1.0]])


def test_no_path_is_refused(model) -> None:
    with pytest.raises(ValueError, match="an outlook needs the optimal path of a task at least"):
        outlook(model, [])


def test_a_detour_keeps_out_of_a_region_that_the_best_way_enters(model, paths) -> None:
    every = np.ones(len(REGIONS), dtype=bool)
    tasks = [path.task for path in paths]
    nothing = np.zeros(len(REGIONS), dtype=bool)
    free = model.under(nothing).with_temperature(0.02 * model.temperature)
    detours, kept_out = tabular_detours(model, tasks, every), 0
    for number, task in enumerate(tasks):
        distribution = TrajectoryDistribution.of_task(free, task)
        if not distribution.is_possible:
            continue
        cells, moves = distribution.sample(1, np.random.default_rng(0))
        for region in np.flatnonzero(model.crossed(cells[:, :-1], moves)[0]).tolist():
            (crossed,) = detours(region, np.array([number]))
            assert not crossed[region]
            later = tabular_detours(model, tasks, np.arange(18) >= region)  # its first is the same
            np.testing.assert_array_equal(later(0, np.array([number])), [crossed[region:]])
            kept_out += int(crossed.any())
    assert kept_out  # of some regions there is a way round
