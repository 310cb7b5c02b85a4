"""Regions and controls at once: all trajectories enumerated, and every pair weighed by hand."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from mlci.actuation.inference import infer_controls
from mlci.actuation.joint import KINDS, NOTHING, JointInference, infer_joint
from mlci.actuation.limited import Limited
from mlci.actuation.moves import ControlledMoves
from mlci.actuation.ranges import ControlRanges
from mlci.demonstrations import Demonstration, Task
from mlci.evidence import Rates
from mlci.forecasts import ForecastCurve, ForecastMap
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.simulate import rollout
from mlci.spaces import Box, StateSpace
from mlci.systems import FunctionSystem
from mlci.tabular import discretize

PLANE = StateSpace(Box([0.0, 0.0], [4.0, 4.0]), [False, False], ("x", "y"))
WALKER = FunctionSystem(lambda x, u: (u[..., 0], u[..., 1]), PLANE, Box([-1.0, -1], [1.0, 1]))
ACTIONS = np.array([[-1.0, 0], [0, 1], [1, 0], [0, -1], [1, 1], [0, 0]])
REGIONS = Regions.from_boxes(
    PLANE, [Box([1.2, 0.2], [1.8, 0.8]), Box([1.2, 1.2], [1.8, 1.8]), Box([3.2, 3.2], [3.8, 3.8])]
)
RANGES = ControlRanges([[-np.inf, -np.inf], [-np.inf, 0.5]], [[-0.5, np.inf], [np.inf, np.inf]])
MODEL = discretize(WALKER, Grid(PLANE, (4, 4)), ACTIONS, 1.0, REGIONS)
TASK = Task(np.array([0.5, 0.5]), Box([2.0, 0.0], [3.0, 1.0]), 4.0)


def enumerated() -> np.ndarray:
    """(C + 1, J + 1) alpha of pairs over all sequences of actions, between centres of cells."""
    total, alpha = 0.0, np.zeros((4, 3))
    held = RANGES.holds(np.zeros((len(ACTIONS), 2)), ACTIONS)
    for sequence in itertools.product(range(len(ACTIONS)), repeat=4):
        places = TASK.start + np.vstack([np.zeros(2), np.cumsum(ACTIONS[list(sequence)], axis=0)])
        if not (np.all((places > 0) & (places < 4)) and np.allclose(places[-1], [2.5, 0.5])):
            continue
        weight = np.exp(-np.sum(ACTIONS[list(sequence)] ** 2))
        total += weight
        keeps_out = np.append(~REGIONS.violated_by(places), True)
        keeps_to = np.append(~np.any(held[list(sequence)], axis=0), True)
        alpha += weight * keeps_out[:, None] * keeps_to[None, :]
    return alpha / total


@pytest.mark.parametrize("exact_ends", [True, False])
def test_pairs_are_avoided_as_often_as_trajectories_say(exact_ends: bool) -> None:
    moves = ControlledMoves.of(MODEL, RANGES, with_regions=True)
    alpha = moves.joint_avoidance([TASK], exact_ends=exact_ends)[0]
    expected = enumerated()
    np.testing.assert_allclose(alpha, expected, atol=1e-12)
    assert alpha[0, 1] == 0  # round the first region one goes up
    product = alpha[:-1, -1:] * alpha[-1:, :-1]
    assert np.max(abs(product - alpha[:-1, :-1])) > 0.05  # they are not independent
    alone = ControlledMoves.of(MODEL, RANGES)
    np.testing.assert_allclose(alone.avoidance([TASK], exact_ends=exact_ends)[0], alpha[-1, :-1])
    np.testing.assert_allclose(alone.shares, moves.shares)
    way = TrajectoryDistribution.of_task(MODEL, TASK, exact_ends=exact_ends)
    np.testing.assert_allclose(way.avoidance_probabilities(), alpha[:-1, -1])
    with pytest.raises(ValueError, match="with_regions=True"):
        alone.joint_avoidance([TASK])


def test_a_task_that_cannot_be_done_says_nothing() -> None:
    far = Task(TASK.start, Box([3.0, 3.0], [4.0, 4.0]), 1.0)
    moves = ControlledMoves.of(MODEL, RANGES, with_regions=True)
    assert np.all(moves.joint_avoidance([far]) == 1)


def demonstration(steps: list[int], name: str) -> Demonstration:
    """A walk by numbers of actions."""
    controls = np.repeat(ACTIONS[steps], 4, axis=0)
    states = rollout(WALKER, TASK.start, controls, 0.25)
    return Demonstration(TASK, states, controls, np.arange(len(states)) * 0.25, name)


def test_the_posterior_of_pairs_is_that_of_the_separate_beliefs_and_of_both() -> None:
    """Up, right, right, down enters the second region; the other walk goes up to the right."""
    walks = [demonstration([1, 2, 2, 3], "round"), demonstration([4, 2, 3, 5], "slanted")]
    rates = Rates(0.1, 0.05)
    apart = infer(MODEL, walks, rates=rates), infer_controls(MODEL, walks, RANGES, rates=rates)
    joint = infer_joint(MODEL, walks, *apart, kinds=(0.4, 0.3, 0.2, 0.1))
    assert joint.violated[0, :, -1].tolist() == [False, True, False, False]
    assert joint.violated[:, -1, 0].tolist() == [False, False]
    assert joint.violated[:, -1, 1].all()
    assert joint.violated[0, 1].all()  # also the pair of which both are
    np.testing.assert_allclose(joint.gain[:-1, -1], apart[0].evidence.sum(axis=0))
    np.testing.assert_allclose(joint.gain[-1, :-1], apart[1].evidence.sum(axis=0))
    prior = np.full((4, 3), 0.1 / 6)
    prior[:-1, -1], prior[-1, :-1], prior[-1, -1] = 0.3 / 3, 0.2 / 2, 0.4
    weight = prior.copy()
    for n, i, j in np.ndindex(joint.avoidance.shape):
        if (i, j) != (3, 2):
            likely = 0.9 * joint.avoidance[n, i, j] + 0.1
            weight[i, j] *= 0.05 if joint.violated[n, i, j] else 0.95 / likely + 0.05
    np.testing.assert_allclose(joint.posterior, weight / weight.sum())
    np.testing.assert_allclose(joint.of_kinds.sum(), 1)
    assert joint.of_kinds[KINDS.index("both")] == pytest.approx(joint.posterior[:-1, :-1].sum())
    np.testing.assert_allclose(joint.of_regions, joint.posterior[:-1].sum(axis=1))
    np.testing.assert_allclose(joint.of_controls, joint.posterior[:, :-1].sum(axis=0))
    frame = joint.to_frame()
    assert tuple(frame.loc[0, ["region", "controls"]]) == joint.most_probable
    assert frame["posterior"].is_monotonic_decreasing
    first = joint.of_some([0])
    np.testing.assert_allclose(first.gain, joint.evidence[0])
    np.testing.assert_array_equal(joint.of_some([1, 0]).of_kinds, joint.of_kinds)


def test_options_count_for_pairs_as_for_the_inferences_of_one() -> None:
    """Ends at cells, a rounded horizon, some regions, and rates that are not theirs."""
    controls = np.repeat([[0.5, 0.5], [0.5, 0.0], [0.0, -0.5]], 7, axis=0)
    states = rollout(WALKER, [0.9, 0.15], controls, 0.2)
    task = Task(states[0], TASK.goal, 4.2)
    walks = [Demonstration(task, states, controls, np.arange(22) * 0.2, "between")]
    some = np.array([True, True, False])
    for exact_ends in (True, False):
        options = {"exact_ends": exact_ends, "round_horizon": True}
        regions = infer(MODEL, walks, hypotheses=some, **options)
        limits = infer_controls(MODEL, walks, RANGES, **options)
        rates = Rates(0.2, 0.1)
        joint = infer_joint(MODEL, walks, regions, limits, hypotheses=some, rates=rates, **options)
        np.testing.assert_allclose(joint.avoidance[:, :-1, -1], regions.avoidance)
        np.testing.assert_allclose(joint.avoidance[:, -1, :-1], limits.avoidance)
        assert joint.regions == (*regions.hypotheses.names, NOTHING)
        alpha, entered = joint.avoidance[0, 1, -1], joint.violated[0, 1, -1]
        assert 0.1 < alpha < 0.9
        expected = 0.1 if entered else 0.9 / (0.8 * alpha + 0.2) + 0.1
        assert joint.gain[1, -1] == pytest.approx(np.log(expected))


def test_a_calibration_does_not_make_pairs_surer_than_no_calibration() -> None:
    """It scored forecasts of one region: the model error whose place it takes counts again."""
    seen = demonstration([1, 2, 2, 3], "round")
    controls = infer_controls(MODEL, [seen], RANGES)
    curve = ForecastCurve((1e-6, 1.0), 9, 99, 0.0, 0.0, 0.0, ceiling=0.6)
    calibrated = infer(MODEL, [seen], calibration=ForecastMap((curve,)))
    assert calibrated.rates.model_error == 0
    plain = infer_joint(MODEL, [seen], infer(MODEL, [seen]), controls)
    np.testing.assert_array_equal(infer_joint(MODEL, [seen], calibrated, controls).gain, plain.gain)


def test_what_a_cell_decides_adds_nothing_to_controls() -> None:
    walks = [demonstration([1, 2, 2, 3], "round")]
    regions, controls = infer(MODEL, walks), infer_controls(MODEL, walks, RANGES)
    decided = replace(regions, decided_by_cell=np.array([[True, True, False]]))
    joint = infer_joint(MODEL, walks, decided, controls)
    np.testing.assert_array_equal(joint.avoidance[:, 0], joint.avoidance[:, -1])
    assert joint.violated[0, :, -1].tolist() == [False, True, False, False]  # who enters, enters


def test_refusals() -> None:
    walks = [demonstration([1, 2, 2, 3], "round")]
    regions, controls = infer(MODEL, walks), infer_controls(MODEL, walks, RANGES)
    with pytest.raises(ValueError, match="do not fit 2 demonstrations and 3 regions"):
        infer_joint(MODEL, walks * 2, regions, controls)
    with pytest.raises(ValueError, match="add up to 1"):
        infer_joint(MODEL, walks, regions, controls, kinds=(0.5, 0.5, 0.5, 0.0))
    with pytest.raises(ValueError, match="the last of each being none"):
        JointInference(
            ("a",), ("b",), np.ones((1, 2, 2)), np.ones((1, 2, 2), bool), (1, 0, 0, 0), Rates()
        )


def test_a_limited_system_has_what_the_limit_leaves() -> None:
    limited = Limited(WALKER, Box([-np.inf, -0.5], [0.25, np.inf]))
    assert limited.control_box.lower.tolist() == [-1, -0.5]
    assert limited.control_box.upper.tolist() == [0.25, 1]
    with pytest.raises(ValueError, match="leaves nothing of the controls"):
        Limited(WALKER, Box([2.0, -1.0], [3.0, 1.0]))
