"""Predicates of states and controls: all trajectories enumerated, and what is no predicate."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import mlci
from mlci.actuation.hypotheses import window_pairs
from mlci.actuation.moves import ControlledMoves
from mlci.evidence import Rates
from mlci.spaces import Floats

LINE = mlci.StateSpace(mlci.Box([0.0], [5.0]), [False], ("x",))
WALKER = mlci.FunctionSystem(lambda x, u: (u[..., 0],), LINE, mlci.Box([-1.0], [1.0]))
ACTIONS = np.array([[-1.0], [0.0], [1.0]])
MODEL = mlci.discretize(
    WALKER, mlci.Grid(LINE, (5,)), ACTIONS, 1.0, mlci.Regions.from_boxes(LINE, [])
)
CART = mlci.DoubleIntegrator()
CHANCE = np.random.default_rng(0)


def right_on_the_right(states: Floats, controls: Floats) -> Floats:
    """A level: below 0 where x > 2.8 and u > 0.5. A first move up from 2.5 is in it, halfway."""
    return np.maximum(2.8 - states[..., 0], 0.5 - controls[..., 0])


def rests_below_two(states: Floats, controls: Floats) -> Floats:
    return (states[..., 0] < 2) & (controls[..., 0] == 0)


PAIRS = mlci.ControlPredicates([right_on_the_right, rests_below_two])


@pytest.mark.parametrize("exact_ends", [False, True])
def test_alpha_is_the_share_of_trajectories_without_such_a_pair(exact_ends: bool) -> None:
    task = mlci.Task(np.array([1.5]), mlci.Box([3.0], [4.0]), 5.0)
    weights, avoiding = 0.0, np.zeros(2)
    for sequence in itertools.product((-1.0, 0.0, 1.0), repeat=5):
        controls = np.array(sequence)
        positions = 1.5 + np.append(0.0, np.cumsum(controls))
        if np.all((positions > 0) & (positions < 5)) and 3 < positions[-1] < 4:
            weight, middles = np.exp(-np.sum(controls**2)), positions[:-1] + controls / 2
            weights += weight
            avoiding[0] += weight * ~np.any((middles > 2.8) & (controls > 0.5))
            avoiding[1] += weight * ~np.any((middles < 2) & (controls == 0))
    alpha = ControlledMoves.of(MODEL, PAIRS).avoidance([task], exact_ends=exact_ends)
    # From 2.5 up is 3 halfway: nobody gets to 3.5 in another way.
    np.testing.assert_allclose(alpha[0], avoiding / weights, atol=1e-12)
    assert alpha[0, 0] == 0
    assert 0.1 < alpha[0, 1] < 0.9


@pytest.mark.parametrize(
    ("start", "goal", "steps", "last"), [(1.5, 3.9, 2, 3.2), (2.9, 3.2, 1, 3.05)]
)
def test_the_last_pair_is_on_the_way_that_is_bent_to_the_goal(
    start: float, goal: float, steps: int, last: float
) -> None:
    """There is one way: up. Its last middle is at 3 from centre to centre."""
    task = mlci.Task(np.array([start]), mlci.Box.point([goal]), float(steps))
    reached = mlci.ControlPredicates(
        [lambda x, u: x[..., 0] > last - 0.01, lambda x, u: x[..., 0] > last + 0.01],
        ("until here", "and beyond"),
    )
    assert ControlledMoves.of(MODEL, reached).avoidance([task])[0].tolist() == [0, 1]


def test_a_level_of_0_is_a_border_that_is_not_forbidden() -> None:
    pushes = mlci.ControlPredicates([lambda x, u: -u[..., 0]], ("pushes",))
    held = pushes.holds(np.zeros((3, 2)), np.array([[-0.1], [0.0], [0.1]]))
    assert held[:, 0].tolist() == [False, False, True]


def test_states_of_moves_across_the_seam_are_wrapped() -> None:
    pendulum = mlci.Pendulum()
    outside = mlci.ControlPredicates(
        [lambda x, u: (u[..., 0] > 0) | (x[..., 0] < 0) | (x[..., 0] > 2 * np.pi)], ("outside",)
    )
    cells, actions = mlci.Grid(pendulum.space, (8, 8)), mlci.action_grid(pendulum, 3)
    model = mlci.discretize(
        pendulum, cells, actions, 0.3, mlci.Regions.from_boxes(pendulum.space, [])
    )
    assert ControlledMoves.of(model, outside).shares == pytest.approx([1 / 3])


def test_pair_is_the_state_in_the_middle_and_the_mean_control() -> None:
    path = mlci.rollout(CART, [0.0, 0.0], [[0.6]] * 8 + [[-0.2]] * 8, 0.125)
    times = np.arange(17) * 0.125
    task = mlci.Task(path[0], mlci.Box.point(path[-1]), 2.0)
    for controls in (np.repeat([[0.6], [-0.2]], 8, axis=0), None):
        of = mlci.Demonstration(task, path, controls, times)
        states, means = window_pairs(CART, of, 1.0)
        np.testing.assert_allclose(means[:, 0], np.linspace(0.6, -0.2, 9), atol=1e-9)
        np.testing.assert_allclose(states, path[4:13], atol=1e-9)


def test_pushing_the_way_one_moves_is_told_from_pushing() -> None:
    """The cart brakes on the right and pushes on the left: only one pair is never applied."""

    def with_the_motion(states: Floats, controls: Floats) -> Floats:
        return (controls[..., 0] > 0.1) & (states[..., 1] > 0.1)

    def against_the_motion(states: Floats, controls: Floats) -> Floats:
        return (controls[..., 0] > 0.1) & (states[..., 1] < -0.1)

    def pushes(states: Floats, controls: Floats) -> Floats:
        return controls[..., 0] > 0.1

    hypotheses = mlci.ControlPredicates([with_the_motion, against_the_motion, pushes])
    path = mlci.rollout(CART, [1.0, -0.8], [[0.4]] * 20, 0.1)
    blind = mlci.Demonstration.from_path(path, 0.1)
    assert hypotheses.applied_by(CART, blind, 0.5).tolist() == [False, True, True]
    # All of 0.4 +- 0.35 are not above 0.1, which is what a tolerance asks.
    assert not hypotheses.applied_by(CART, blind, 0.5, 0.35).any()
    grid, actions = mlci.Grid(CART.space, (20, 20)), mlci.action_grid(CART, 5)
    regions = mlci.Regions.from_boxes(CART.space, [])
    model = mlci.discretize(CART, grid, actions, 0.5, regions)
    inference = mlci.infer_controls(model, [blind], hypotheses, rates=Rates(0.0))
    assert inference.ranking.order[0] == 0
    assert inference.ranking.gain[0] == pytest.approx(-np.log(inference.avoidance[0, 0]))
    assert inference.ranking.gain[1:].tolist() == [-np.inf, -np.inf]
    assert inference.to_frame()["name"].tolist()[0] == "with_the_motion"


def test_states_are_wrapped_before_a_function_is_asked() -> None:
    system = mlci.Pendulum()
    limits = system.space.bounds
    seen: list[Floats] = []

    def looks(states: Floats, controls: Floats) -> Floats:
        seen.append(states)
        return controls[..., 0] > 0

    path = mlci.rollout(system, [6.0, 3.0], [[0.0]] * 20, 0.05)
    assert path[-1, 0] > limits.upper[0]
    demonstration = mlci.Demonstration.from_path(path, 0.05)
    mlci.ControlPredicates([looks]).applied_by(system, demonstration, 0.25)
    assert np.all(seen[0] >= limits.lower)
    assert np.all(seen[0] <= limits.upper)


def test_map_of_forecasts_lowers_what_one_demonstration_brings() -> None:
    """Nobody forbids these walkers anything, and half of them rest although the model would not."""
    task = mlci.Task(np.array([1.5]), mlci.Box([1.0], [2.0]), 3.0)
    times = np.arange(4.0)

    def walk(*controls: float) -> mlci.Demonstration:
        states = 1.5 + np.append(0.0, np.cumsum(controls))[:, None]
        return mlci.Demonstration(task, states, np.array(controls)[:, None], times)

    rests, walks = walk(0.0, 0.0, 0.0), walk(1.0, 0.0, -1.0)
    some = mlci.ControlPredicates([rests_below_two])
    seen = [rests] * 5 + [walks] * 15
    forecasts = mlci.calibrate_controls(MODEL, seen, some)
    assert forecasts is not None
    plain = mlci.infer_controls(MODEL, [walks], some, rates=Rates(0.0))
    calibrated = mlci.infer_controls(MODEL, [walks], some, calibration=forecasts)
    assert plain.avoidance[0, 0] < 0.2
    # 15 of 20 walk: the gain is -log of about 0.75, with a prior of one task.
    assert calibrated.ranking.gain[0] == pytest.approx(-np.log(0.75), abs=0.1)
    up = mlci.ControlPredicates([lambda x, u: (x[..., 0] > 4.2) & (u[..., 0] > 0)], ("far",))
    assert mlci.calibrate_controls(MODEL, [walk(0.0, 0.0, 0.0)], up) is None


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: mlci.ControlPredicates([3.0]), "a list of functions of states and controls"),
        (lambda: mlci.ControlPredicates(rests_below_two), "need a list of functions"),
        (lambda: mlci.ControlPredicates([rests_below_two] * 2), "2 functions need as many diff"),
        (lambda: mlci.ControlPredicates([rests_below_two], ("a", "b")), "1 functions need as many"),
    ],
)
def test_what_is_no_list_of_predicates_is_refused(make, message) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x, u: np.zeros(3), r"must return a truth value or a level a pair, .* \(3,\)"),
        (lambda x, u: u, "must return a truth value"),
        (lambda x, u: np.full(len(x), "yes"), "must return a truth value"),
        (lambda x, u: np.full(len(x), np.nan), "returned NaN"),
        (lambda x, u: u[..., 0] > CHANCE.normal(), "answers differently when it is asked again"),
        (lambda x, u: x[..., 0] * (1 if len(x) == 4096 else np.nan), r"it returned float64 .* NaN"),
        (lambda x, u: u[..., 0] > 0 if len(x) == 4096 else True, r"it returned bool of shape \(\)"),
        (lambda x, u: x[..., 7] > 0, "bad fails for states .* IndexError"),
        (lambda x: x, "bad fails for states .* TypeError"),
        (lambda x, u: x[..., 0] > 99, "bad forbids none of the model's moves, of 3 actions"),
    ],
)
def test_predicate_that_cannot_be_asked_is_refused(function, message) -> None:
    with pytest.raises(ValueError, match=message):
        mlci.infer_controls(MODEL, [], mlci.ControlPredicates([function], ("bad",)))


@pytest.mark.parametrize("tolerance", [-0.1, np.nan, np.inf, [0.1, 0.1]])
def test_tolerance_must_fit_the_controls(tolerance) -> None:
    with pytest.raises(ValueError, match="1 numbers of at least 0, one a control"):
        mlci.infer_controls(MODEL, [], PAIRS, tolerance=tolerance)


def test_models_without_cells_and_controls_of_others_are_refused() -> None:
    sampled = mlci.SampledModel(WALKER, mlci.Regions.from_boxes(LINE, []), 1.0)
    with pytest.raises(TypeError, match="needs a TabularModel; a SampledModel has no cells"):
        mlci.infer_controls(sampled, [], PAIRS)
    task = mlci.Task(np.array([1.5]), mlci.Box([1.0], [2.0]), 1.0)
    two = mlci.Demonstration(task, [[1.5], [1.5]], np.zeros((1, 2)), np.arange(2.0), "two")
    with pytest.raises(ValueError, match="'two' has 2 controls, the system 1"):
        mlci.infer_controls(MODEL, [two], PAIRS)
