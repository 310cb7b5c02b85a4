"""Ranges of controls: all trajectories enumerated, controls recorded and reconstructed, limits."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from mlci.actuation.inference import infer_controls
from mlci.actuation.moves import ControlledMoves
from mlci.actuation.ranges import ControlRanges
from mlci.demonstrations import Demonstration, Task
from mlci.demonstrator import demonstrate, sample_trials
from mlci.evidence import DEFAULT_MODEL_ERROR, Rates
from mlci.exploration import explore
from mlci.forecasts import ForecastCurve, ForecastMap
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.simulate import rollout
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, FunctionSystem
from mlci.tabular import TabularModel, action_grid, discretize

LINE = StateSpace(Box([0.0], [5.0]), [False], ("x",))
WALKER = FunctionSystem(lambda x, u: (u[..., 0],), LINE, Box([-1.0], [1.0]))
NO_REGIONS = Regions.from_boxes(LINE, [])
FAST = ControlRanges(
    [[0.5], [-np.inf], [-np.inf]], [[np.inf], [-0.5], [0.5]], ("up", "down", "slow")
)
CART = DoubleIntegrator()
RANGES = ControlRanges.beyond(CART, [0.25, 0.5, 0.75])
LIMIT = float(CART.control_box.upper[0])


def test_alpha_is_the_share_of_trajectories_that_take_no_such_action() -> None:
    actions = np.array([[-1.0], [0.0], [1.0]])
    model = discretize(WALKER, Grid(LINE, (5,)), actions, 1.0, NO_REGIONS)
    task = Task(np.array([2.5]), Box([3.0], [4.0]), 4.0)
    moves = ControlledMoves.of(model, FAST)
    np.testing.assert_allclose(moves.shares, [1 / 3, 1 / 3, 2 / 3])
    held = FAST.holds(np.zeros((3, 1)), actions)
    weights, avoiding = 0.0, np.zeros(3)
    for sequence in itertools.product(range(3), repeat=4):
        positions = 2.5 + np.cumsum(actions[list(sequence), 0])
        if np.all((positions > 0) & (positions < 5)) and 3 < positions[-1] < 4:
            weight = np.exp(-np.sum(actions[list(sequence)] ** 2))
            weights += weight
            avoiding += weight * ~np.any(held[list(sequence)], axis=0)
    for exact_ends in (False, True):
        alpha = moves.avoidance([task], exact_ends=exact_ends)
        # Without "up" nobody gets up; "slow" holds all that does not.
        np.testing.assert_allclose(alpha[0], avoiding / weights, atol=1e-12)
    assert alpha[0, 0] == 0
    assert 0 < alpha[0, 1] < 1


def test_shares_are_of_the_moves_that_are_known() -> None:
    """In two steps from the left end a walker comes to three cells of five."""
    actions = np.array([[-1.0], [0.0], [1.0]])
    model = discretize(WALKER, Grid(LINE, (5,)), actions, 1.0, NO_REGIONS)
    task = Task(np.array([0.5]), Box([2.0], [3.0]), 2.0)
    active = explore(model, [task], bounded=False)
    assert active.explored is not None
    assert np.sum(active.explored.cells) < 5
    np.testing.assert_allclose(ControlledMoves.of(active, FAST).shares, [1 / 3, 1 / 3, 2 / 3])


@pytest.mark.parametrize("exact_ends", [False, True])
@pytest.mark.parametrize("samples", [1, 2])
def test_alpha_is_the_ratio_of_partition_functions(exact_ends: bool, samples: int) -> None:
    """alpha = Z_i / Z, with Z_i of a model that lacks the actions; one step, and several."""
    regions = Regions.from_boxes(CART.space, [Box([-1.0, -0.5], [-0.5, 0.5])])
    ranges = ControlRanges([[0.3 * LIMIT], [-np.inf]], [[np.inf], [-0.7 * LIMIT]])
    grid, actions = Grid(CART.space, (12, 12)), action_grid(CART, 5)
    model = discretize(CART, grid, actions, 0.5, regions, samples=samples).under([True])
    goal = Box([-0.5, -0.5], [0.5, 0.5])
    tasks = [Task(np.array([-0.2, 0.4]), goal, 0.5 * steps) for steps in (1, 2, 4)]
    alpha = ControlledMoves.of(model, ranges).avoidance(tasks, exact_ends=exact_ends)
    log_z = np.array([_log_z(model, task, exact_ends) for task in tasks])
    assert np.all(log_z > -np.inf)
    for i in range(2):
        some = actions[~ranges.holds(np.zeros((5, 2)), actions)[:, i]]
        fewer = discretize(CART, grid, some, 0.5, regions, samples=samples).under([True])
        vars(fewer)["substeps"] = model.substeps
        ratio = np.exp([_log_z(fewer, task, exact_ends) for task in tasks] - log_z)
        np.testing.assert_allclose(alpha[:, i], ratio, rtol=1e-9)


def _log_z(model: TabularModel, task: Task, exact_ends: bool) -> float:
    way = TrajectoryDistribution.of_task(model, task, exact_ends=exact_ends)
    return float(way.log_z[0, way.start])


def cart_path(controls: list[float], hold: int = 50, dt: float = 0.01) -> Demonstration:
    """The cart from rest under controls that are each held for half a second."""
    applied = np.repeat(controls, hold)[:, None]
    states = rollout(CART, [0.0, 0.0], applied, dt)
    return Demonstration(
        Task(states[0], Box.point(states[-1]), len(applied) * dt),
        states,
        applied,
        np.arange(len(states)) * dt,
    )


def test_recorded_and_reconstructed_controls_tell_the_same() -> None:
    recorded = cart_path([0.6 * LIMIT, -0.3 * LIMIT, 0.1 * LIMIT])
    assert RANGES.applied_by(CART, recorded, 0.25).tolist() == [
        True,
        True,
        False,
        True,
        False,
        False,
    ]
    blind = Demonstration(recorded.task, recorded.states, None, recorded.times)
    np.testing.assert_array_equal(
        RANGES.applied_by(CART, blind, 0.25, 1e-6), RANGES.applied_by(CART, recorded, 0.25)
    )


def test_noise_is_averaged_and_borders_tolerated() -> None:
    path = cart_path([0.5 * LIMIT, -0.5 * LIMIT])
    at_most_half = [True, False, False, True, False, False]
    assert RANGES.applied_by(CART, path, 0.25).tolist() == at_most_half
    rng = np.random.default_rng(0)
    shaky = path.states + rng.normal(0, [2e-4, 3e-3], path.states.shape)
    shaky[[0, -1]] = path.states[[0, -1]]
    noisy = Demonstration(path.task, shaky, None, path.times)
    assert RANGES.applied_by(CART, noisy, 0.01).all()  # spikes of single samples
    assert RANGES.applied_by(CART, noisy, 0.25, 0.1 * LIMIT).tolist() == at_most_half
    burst = cart_path([0.0] * 10 + [0.9 * LIMIT] + [0.0] * 10, hold=5)
    assert RANGES.applied_by(CART, burst, 0.05)[2]
    assert not RANGES.applied_by(CART, burst, 0.5).any()


def test_window_that_ends_with_a_sample_counts() -> None:
    times = np.array([0.0, 0.4, 0.7, 1.1])
    path = Demonstration(
        Task(np.zeros(2), Box.point(np.zeros(2)), 1.1),
        np.zeros((4, 2)),
        np.array([[0.8], [1.0], [0.0]]),
        times,
    )
    # From 0.2 to 0.7 s the mean is 0.92; of windows that begin with a sample, 0.84 at most.
    ranges = ControlRanges([[0.9], [0.93]], [[np.inf], [np.inf]])
    assert ranges.applied_by(CART, path, 0.5).tolist() == [True, False]


def test_limit_is_what_a_range_leaves() -> None:
    box = Box([-1.0, -2.0], [1.0, 2.0])
    free = np.inf
    ranges = ControlRanges(
        [[0.5, -free], [-free, -free], [-0.5, -free], [0.5, 0.5], [2.0, -free], [-2.0, -free]],
        [[free, free], [free, -1.0], [0.5, free], [free, free], [free, free], [free, free]],
    )
    upper, lower = (ranges.left_of(box, i) for i in range(2))
    assert (upper.lower.tolist(), upper.upper.tolist()) == ([-1, -2], [0.5, 2])
    assert (lower.lower.tolist(), lower.upper.tolist()) == ([-1, -1], [1, 2])
    for i in range(2, 6):
        with pytest.raises(ValueError, match="must cut off one end of one control"):
            ranges.left_of(box, i)


def test_limit_is_what_all_ranges_leave() -> None:
    ranges = ControlRanges([[0.5], [0.8], [-np.inf]], [[np.inf], [np.inf], [-0.6]])
    left = ranges.left_by_all(Box([-1.0], [1.0]))
    assert (left.lower.tolist(), left.upper.tolist()) == ([-0.6], [0.5])


def test_shares_are_of_the_way_from_the_middle_of_a_range() -> None:
    forward = FunctionSystem(lambda x, u: (u[..., 0],), LINE, Box([-1.0], [3.0]))
    ranges = ControlRanges.beyond(forward, [0.5])
    assert ranges.lower.tolist() == [[2.0], [-np.inf]]
    assert ranges.upper.tolist() == [[np.inf], [0.0]]


def test_a_joint_that_will_not_push_is_found() -> None:
    ranges = ControlRanges.beyond(CART, [0.5])
    limit = ranges.left_of(CART.control_box, 0)
    trials = sample_trials(
        CART, None, Box([-2, -0.5], [2, 0.5]), trials=16, seed=1, horizon=3.0, dt=0.05, restarts=1
    )
    attempts = demonstrate(CART, trials, None, None, dt=0.05, limit=limit)
    paths = [each.demonstration for each in attempts if each.outcome == "kept"]
    assert len(paths) >= 6
    regions = Regions.from_boxes(CART.space, [])
    model = discretize(CART, Grid(CART.space, (24, 16)), action_grid(CART, 9), 0.25, regions)
    inference = infer_controls(model, paths, ranges, tolerance=1e-6)
    assert not inference.applied[:, 0].any()
    assert inference.ranking.order[0] == 0
    assert inference.ranking.gain[0] > 0
    table = inference.to_frame()
    assert table["name"][0] == ranges.names[0]
    assert table["applied_by"][0] == 0


def test_posterior_is_that_of_equation_5() -> None:
    path = cart_path([0.3 * LIMIT, -0.3 * LIMIT, 0.0, 0.0])
    regions = Regions.from_boxes(CART.space, [])
    model = discretize(CART, Grid(CART.space, (24, 16)), action_grid(CART, 9), 0.25, regions)
    inference = infer_controls(model, [path], RANGES, rates=Rates(0.0), prior_none=0.4)
    likelihood = np.where(inference.applied[0], 0.0, 1 / inference.avoidance[0])
    weight = np.append(0.1 * likelihood, 0.4)
    np.testing.assert_allclose(inference.ranking.posterior, (weight / weight.sum())[:-1], rtol=1e-9)


def test_a_map_of_forecasts_takes_the_place_of_the_model_error() -> None:
    """Each share of the moves has the curve of its size; of 9 actions a ninth is above 0.75."""
    path = cart_path([0.1 * LIMIT, 0.0, -0.1 * LIMIT])
    regions = Regions.from_boxes(CART.space, [])
    model = discretize(CART, Grid(CART.space, (24, 16)), action_grid(CART, 9), 0.25, regions)
    curves = [
        ForecastCurve(sizes, 9, 99, 0.0, 0.0, 0.0, ceiling=ceiling)
        for sizes, ceiling in (((0.05, 0.15), 0.6), ((0.2, 0.5), 0.9))
    ]
    inferred = infer_controls(model, [path], RANGES, calibration=ForecastMap(tuple(curves)))
    assert not inferred.applied.any()
    of_few = np.isclose(inferred.shares, 1 / 9)
    assert of_few.tolist() == [False, False, True] * 2
    mapped = [each.avoidance(inferred.avoidance[0]) for each in curves]
    gain = -np.log(np.where(of_few, *mapped))
    assert np.max(np.abs(mapped[0] - mapped[1])[of_few]) > 0.01
    np.testing.assert_allclose(inferred.ranking.gain, gain, atol=1e-12)


def test_a_demonstration_shorter_than_a_time_step_is_one_window() -> None:
    path = cart_path([0.6 * LIMIT], hold=30)  # 0.3 s
    regions, actions = Regions.from_boxes(CART.space, []), action_grid(CART, 9)
    model = discretize(CART, Grid(CART.space, (12, 8)), actions, 0.5, regions)
    inference = infer_controls(model, [path], RANGES, round_horizon=True)
    assert inference.applied.tolist() == [[True, True, False, False, False, False]]


@pytest.mark.parametrize("exact_ends", [False, True])
def test_options_reach_the_probabilities_and_the_evidence(exact_ends: bool) -> None:
    """A horizon of 1.68 s is rounded to 3 steps; the model error is the library's own."""
    path = cart_path([0.6 * LIMIT, 0.2 * LIMIT, -0.4 * LIMIT, 0.0], hold=42)
    regions, actions = Regions.from_boxes(CART.space, []), action_grid(CART, 9)
    model = discretize(CART, Grid(CART.space, (24, 16)), actions, 0.5, regions)
    with pytest.raises(ValueError, match="horizon"):
        infer_controls(model, [path], RANGES, exact_ends=exact_ends)
    inference = infer_controls(
        model, [path], RANGES, tolerance=0.2 * LIMIT, exact_ends=exact_ends, round_horizon=True
    )
    three = replace(path.task, horizon=1.5)
    moves = ControlledMoves.of(model, RANGES)
    alpha, other = (
        moves.avoidance([three], exact_ends=ends) for ends in (exact_ends, not exact_ends)
    )
    np.testing.assert_allclose(inference.avoidance, alpha, atol=1e-12)
    assert np.max(np.abs(alpha - other)) > 0.01
    # 0.6 is deep enough in what is above 0.25 alone, -0.4 in none of what is below.
    assert inference.applied.tolist() == [[True, False, False, False, False, False]]
    eta = DEFAULT_MODEL_ERROR
    gain = np.where(inference.applied[0], -np.inf, -np.log((1 - eta) * alpha[0] + eta))
    np.testing.assert_allclose(inference.ranking.gain, gain, atol=1e-12)
    broken = infer_controls(model, [path], RANGES, rates=Rates(0.0, 0.2), round_horizon=True)
    assert broken.ranking.gain[0] == pytest.approx(np.log(0.2))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ControlRanges([1.0], [2.0]), r"ends of one shape \(C, m\)"),
        (lambda: ControlRanges([[2.0]], [[1.0]]), "range 0 needs lower < upper and a finite end"),
        (lambda: ControlRanges([[-np.inf]], [[np.inf]]), "a finite end"),
        (lambda: ControlRanges([[0.0]], [[1.0]], ("a", "b")), "1 ranges need as many"),
        (lambda: ControlRanges.beyond(CART, [1.0]), r"lie in \(0, 1\)"),
        (lambda: RANGES.applied_by(CART, cart_path([0.0]), 2.0), "at most 0.5 s, as long as"),
    ],
)
def test_impossible_ranges_are_refused(make, message) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_ranges_that_a_model_cannot_tell_are_refused() -> None:
    regions = Regions.from_boxes(CART.space, [])
    model = discretize(CART, Grid(CART.space, (6, 6)), action_grid(CART, 3), 0.5, regions)
    narrow = ControlRanges([[0.2 * LIMIT]], [[0.4 * LIMIT]])
    with pytest.raises(
        ValueError,
        match=r"control 1 from 0\.2 to 0\.4 forbids none of the model's moves, of 3 actions",
    ):
        infer_controls(model, [], narrow)
    with pytest.raises(ValueError, match="ranges of 2 controls do not fit actions of 1"):
        infer_controls(model, [], ControlRanges([[0.0, 0.0]], [[1.0, 1.0]]))
