import numpy as np
import pytest
from linear_bridge import random_bridge

from mlci.sampled.modes import GOAL_SHARE, find_modes
from mlci.sampled.passage import Passage
from mlci.spaces import Box
from mlci.systems import Pendulum


@pytest.mark.parametrize("seed", [0, 1])
def test_a_linear_passage_has_one_mode_which_least_squares_give(seed):
    bridge = random_bridge(np.random.default_rng(seed))
    modes = find_modes(bridge.passage, 4, np.random.default_rng(1))
    assert len(modes) == 1
    assert modes.restarts[0] == 4
    assert not modes.late[0]
    price = bridge.passage.goal_price(GOAL_SHARE)
    rows = np.concatenate([np.eye(12) * np.sqrt(0.25), np.sqrt(price)[:, None] * bridge.reach])
    apart = bridge.passage.nearest_goal - bridge.end_without_control
    target = np.concatenate([np.zeros(12), np.sqrt(price) * apart])
    exact, rest, *_ = np.linalg.lstsq(rows, target)
    np.testing.assert_allclose(modes.controls[0, :, 0], exact, atol=1e-3)
    assert modes.cost[0] == pytest.approx(rest[0] / bridge.passage.temperature, rel=1e-5)


def test_a_pendulum_has_a_mode_for_each_winding_that_counts():
    goal = Box([5.2, -0.65], [5.7, -0.55])
    passage = Passage(Pendulum(), np.array([3.37, 0.29]), goal, 20, 0.25)
    modes = find_modes(passage, 6, np.random.default_rng(0))
    turns = np.round((modes.goals[:, 0] - passage.nearest_goal[0]) / (2 * np.pi))
    assert {0, 1, -1} <= set(turns)
    assert np.all(np.diff(modes.cost) >= 0)
    assert modes.cost[-1] < modes.cost[0] + 12
    half = GOAL_SHARE * passage.half
    assert np.all(np.abs(modes.states[:, -1] - modes.goals) < 3 * half)
    # No control that is a little different costs less: each is a mode.
    rng = np.random.default_rng(1)
    for controls, goal_state, cost in zip(modes.controls, modes.goals, modes.cost, strict=True):
        moved = controls + 0.02 * rng.standard_normal((300, 20, 1))
        states = np.tile(passage.start, (300, 1))
        for k in range(20):
            step = passage.integrator.step
            states = step(passage.system, states, moved[:, k], passage.dt)
        missed = np.square(states - goal_state) @ passage.goal_price(GOAL_SHARE)
        assert np.min(missed - passage.log_reward(states[:, None], moved)) > cost - 1e-4


def test_a_limit_holds_for_modes():
    passage = Passage(
        *(Pendulum(), np.array([0.0, 0.0]), Box([3.0, -0.1], [3.2, 0.1]), 8, 0.25),
        limit=Box([-1.0], [1.0]),
    )
    modes = find_modes(passage, 4, np.random.default_rng(0))
    assert np.max(np.abs(modes.controls)) == pytest.approx(1.0)


def test_a_goal_that_is_free_in_the_angle_has_no_windings():
    passage = Passage(Pendulum(), np.array([1.0, 0.0]), Box([-9.0, 0.4], [9.0, 0.6]), 8, 0.25)
    modes = find_modes(passage, 4, np.random.default_rng(0))
    np.testing.assert_array_equal(modes.goals[:, 0], modes.goals[0, 0])
