"""The paper's measures, in a world small enough to list every trajectory by hand."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.measures import Measures, measure_point, rollout_errors
from experiments.point.streams import Purpose, stream
from mlci.demonstrations import Demonstration
from mlci.diagnosis import diagnose
from mlci.grids import Grid
from mlci.metrics import violation_distance
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.simulate import rollout
from mlci.spaces import Box, StateSpace
from mlci.systems import FunctionSystem, Pendulum
from mlci.tabular import discretize

# A floor of 4 x 3 tiles, on which one steps to a neighbour or stays; the tile in its middle row at
# x from 1 to 2 is forbidden. Moves lead from centre to centre, so that the model is exact.
SPACE = StateSpace(Box([0.0, 0.0], [4.0, 3.0]), [False, False], ("x", "y"), ("m", "m"))
FLOOR = FunctionSystem(lambda x, u: (u[..., 0], u[..., 1]), SPACE, Box([-1.0, -1.0], [1.0, 1.0]))
STEPS = np.array(list(itertools.product([-1.0, 0.0, 1.0], repeat=2)))
TILES = Regions.from_grid(SPACE, (4, 3))
FORBIDDEN = Regions.from_boxes(SPACE, [Box([1.0, 1.0], [2.0, 2.0])], ["truth_0"])
# Round the forbidden tile: below it, and above it; and one whose goal is the forbidden tile.
PATHS = [
    ([0.6, 1.4], [[1, -1], [1, 1], [1, 0]]),
    ([0.5, 1.5], [[1, 1], [1, -1], [0, 0]]),
    ([0.5, 1.5], [[0, 0]]),
]
GOAL_OFFSETS = [(0.0, 0.0), (0.25, 0.0), (1.0, 0.0)]


def demonstrations() -> tuple[Demonstration, ...]:
    paths = [rollout(FLOOR, start, np.array(moves, float), 1.0) for start, moves in PATHS]
    return tuple(
        Demonstration.from_path(path, 1.0, goal=Box.point(path[-1] + offset), name=str(number))
        for number, (path, offset) in enumerate(zip(paths, GOAL_OFFSETS, strict=True))
    )


@pytest.fixture(scope="module")
def point() -> PointInference:
    regions = FORBIDDEN.joined(Regions(SPACE, TILES.lower, TILES.upper, TILES.names))
    model = discretize(FLOOR, Grid(SPACE, (4, 3)), STEPS, 1.0, regions)
    hypotheses = regions.mask(TILES.names)
    return PointInference(
        trials=None,
        numbers=np.array([4, 7, 9]),
        demonstrations=demonstrations(),
        model=model,
        hypotheses=hypotheses,
        truth=regions.mask(["truth_0"]),
        inference=infer(
            model, demonstrations(), hypotheses=hypotheses, tolerance=1.0, exact_ends=False
        ),
        diagnosis=diagnose(model),
    )


@pytest.fixture
def measured(settings: Settings, point: PointInference) -> Measures:
    return measure_point(dataclasses.replace(settings, rollouts=200, seed=3), point)


def listed(demonstration: Demonstration, truth: bool) -> tuple[float, np.ndarray]:
    """Z and the part of it that crosses each tile, over all sequences of steps."""
    start = FLOOR.space.bounds.lower + np.floor(demonstration.task.start) + 0.5
    total, crossing = 0.0, np.zeros(len(TILES))
    for moves in itertools.product(STEPS, repeat=len(demonstration.states) - 1):
        path = start + np.vstack([[0, 0], np.cumsum(moves, axis=0)])
        inside = np.all((path >= SPACE.bounds.lower) & (path <= SPACE.bounds.upper))
        ends = np.all(np.floor(path[-1]) == np.floor(demonstration.task.goal.lower))
        if not (inside and ends) or (truth and FORBIDDEN.violated_by(path)[0]):
            continue
        weight = np.exp(-np.sum(np.square(moves)))
        total += weight
        crossing += weight * TILES.violated_by(path)
    return total, crossing


def test_probabilities_are_those_of_all_trajectories_under_the_truth(
    measured: Measures, point: PointInference
) -> None:
    """And those of the inference are without it."""
    assert measured.feasible.tolist() == [True, True, False]
    for j, demonstration in enumerate(point.demonstrations[:2]):
        for phi, truth in ((measured.phi, True), (point.inference.phi, False)):
            total, crossing = listed(demonstration, truth)
            np.testing.assert_allclose(phi[j], crossing / total, rtol=0, atol=1e-12)
    assert TILES.inside(FORBIDDEN).tolist().index(True) == 4
    assert np.all(measured.phi[:, 4] == 0)
    assert np.all(point.inference.phi[:2, 4] > 0.1)
    assert not measured.phi[2].any()
    assert point.inference.reachable.all()
    assert point.inference.phi[2, 4] == 1


def test_distances_compare_with_the_truth_respected(
    measured: Measures, point: PointInference
) -> None:
    violated = np.array([TILES.violated_by(each.states) for each in point.demonstrations])
    np.testing.assert_array_equal(point.inference.violated, violated)
    under_truth = [listed(each, truth=True) for each in point.demonstrations[:2]]
    phi = np.array([crossing / total for total, crossing in under_truth])
    expected = violation_distance(phi, violated[:2])
    np.testing.assert_allclose(measured.violation_distance[:2], expected.each, atol=1e-12)
    np.testing.assert_allclose(measured.violation_floor[:2], expected.floor, atol=1e-12)
    np.testing.assert_allclose(measured.violation_share[:2], expected.shares, atol=1e-12)
    for name in ("violation_distance", "violation_floor", "violation_share", "final_state_error"):
        assert np.isnan(getattr(measured, name)[2])


def test_final_state_error_is_what_the_cells_round_away(measured: Measures) -> None:
    """Steps lead to the goal's tile, at the place in it that the true start has in its own."""
    np.testing.assert_allclose(measured.final_state_error[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(measured.final_state_error[1], 0.25 / 4, atol=1e-12)


def test_one_sampled_trajectory_is_kept_of_each_that_is_feasible(
    settings: Settings, measured: Measures, point: PointInference
) -> None:
    assert list(measured.trajectories) == [4, 7]
    for number, (cells, moves) in measured.trajectories.items():
        demonstration = point.demonstrations[[4, 7].index(number)]
        assert cells[0] == point.model.grid.index(demonstration.task.start)
        assert cells[-1] == point.model.grid.index(demonstration.task.goal.lower)
        np.testing.assert_array_equal(point.model.kept.successor[cells[:-1], moves], cells[1:])
        crossed = point.model.kept.crosses[cells[:-1] * point.model.moves + moves].toarray()
        assert not crossed[:, point.truth].any()
    others = measure_point(dataclasses.replace(settings, rollouts=200, seed=4), point)
    assert any(
        not np.array_equal(measured.trajectories[number][1], others.trajectories[number][1])
        for number in (4, 7)
    )


def test_sampled_controls_act_on_the_true_dynamics_in_small_steps() -> None:
    """One step of the integrator a control would be off by a hundred times the tolerance."""
    system = Pendulum()
    goal, starts = Box.point([2.0, 0.5]), [[0.3, 1.0], [4.0, -2.0]]
    controls = np.random.default_rng(0).uniform(-2, 2, (2, 3, 4, 1))

    def flow(start: list[float], held: np.ndarray) -> np.ndarray:
        state = np.array(start)
        for control in held:
            solution = solve_ivp(
                lambda _, x, u=control: system.dynamics(x, u),
                (0, 1.0),
                state,
                rtol=1e-10,
                atol=1e-12,
            )
            state = solution.y[:, -1]
        return state

    made = [Demonstration.from_path(np.array([start, start]), 4.0, goal=goal) for start in starts]
    expected = []
    for start, of_task in zip(starts, controls, strict=True):
        ends = np.array([flow(start, held) for held in of_task])
        off = system.space.difference(ends, goal.lower) / [2 * np.pi, 12.0]
        expected.append(np.mean(np.linalg.norm(off, axis=1)))
    errors = rollout_errors(system, made, controls, 1.0, 0.02)
    np.testing.assert_allclose(errors, expected, atol=1e-6)
    coarse = rollout_errors(system, made, controls, 1.0, 1.0)
    assert np.max(np.abs(coarse - expected)) > 1e-4


def test_streams_differ_by_seed_purpose_and_index() -> None:
    draws = [
        stream(seed, purpose, *index).random()
        for seed in (0, 1)
        for purpose in Purpose
        for index in ((0,), (1,), (0, 1), (1, 0))
    ]
    assert len(set(draws)) == len(draws)
    assert stream(0, Purpose.SUBSETS, 0).random() == stream(0, Purpose.SUBSETS, 0).random()


def test_measures_stand_with_their_demonstrations_in_any_order(
    settings: Settings, measured: Measures, point: PointInference
) -> None:
    """Tasks of one duration are measured together; here those come after another."""
    order = [2, 0, 1]
    turned = dataclasses.replace(
        point,
        numbers=point.numbers[order],
        demonstrations=tuple(point.demonstrations[j] for j in order),
        inference=point.inference.of(order),
    )
    again = measure_point(dataclasses.replace(settings, rollouts=200, seed=3), turned)
    for name in ("feasible", "phi", "final_state_error", "violation_distance", "violation_share"):
        np.testing.assert_allclose(getattr(again, name), getattr(measured, name)[order], atol=1e-12)
    assert list(again.trajectories) == [4, 7]


def test_no_step_of_the_integrator_is_longer_than_asked_for() -> None:
    made = [Demonstration.from_path(np.array([[0.3, 1.0]] * 2), 1.0, goal=Box.point([2.0, 0.5]))]
    controls = np.ones((1, 1, 3, 1))
    half, longer, whole = (
        rollout_errors(Pendulum(), made, controls, 1.0, step) for step in (0.5, 0.6, 1.0)
    )
    assert half == longer != whole
