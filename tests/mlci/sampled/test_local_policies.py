import numpy as np
import pytest
from linear_bridge import Bridge, random_bridge

from mlci.sampled.local_policies import LocalPolicies, refit, riccati_policies
from mlci.sampled.modes import GOAL_SHARE, find_modes
from mlci.sampled.passage import Passage
from mlci.spaces import Box, Floats
from mlci.systems import Pendulum


def bridge_and_policies(seed: int) -> tuple[Bridge, LocalPolicies, float]:
    bridge = random_bridge(np.random.default_rng(seed))
    modes = find_modes(bridge.passage, 2, np.random.default_rng(0))
    policies, log_integral = riccati_policies(bridge.passage, modes)
    return bridge, policies, float(log_integral[0])


def law_of_controls(bridge: Bridge) -> tuple[Floats, Floats, float]:
    """Mean and covariance of the controls given a Gaussian goal, and the log of its integral."""
    passage, reach = bridge.passage, bridge.reach
    deviation = GOAL_SHARE * passage.half
    precision = np.eye(passage.steps) / bridge.variance
    precision = precision + reach.T @ np.diag(deviation**-2) @ reach
    apart = passage.nearest_goal - bridge.end_without_control
    mean = np.linalg.solve(precision, reach.T @ (apart / deviation**2))
    least = mean @ mean / (2 * bridge.variance)
    least += np.sum(np.square((apart - reach @ mean) / deviation)) / 2
    log_volume = passage.steps / 2 * np.log(2 * np.pi) - np.linalg.slogdet(precision)[1] / 2
    return mean, np.linalg.inv(precision), float(log_volume - least)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_for_a_linear_system_the_policy_is_the_law_of_the_controls(seed):
    bridge, policies, log_integral = bridge_and_policies(seed)
    mean, covariance, exact = law_of_controls(bridge)
    assert len(policies) == 1
    assert log_integral == pytest.approx(exact, abs=1e-6)
    # The first control is free of the state; of the second the law given the first.
    np.testing.assert_allclose(policies.mean[0, 0], mean[0], atol=1e-5)
    np.testing.assert_allclose(policies.root[0, 0, 0, 0] ** 2, covariance[0, 0], rtol=1e-5)
    passage, first = bridge.passage, mean[0] + 0.7
    state = passage.integrator.step(passage.system, passage.start, np.array([first]), passage.dt)
    apart = state - policies.states[0, 1]
    second = policies.mean[0, 1, 0] + policies.gain[0, 1, 0] @ apart
    given = mean[1] + covariance[0, 1] / covariance[0, 0] * 0.7
    assert second == pytest.approx(given, abs=1e-4)
    rest = covariance[1, 1] - covariance[0, 1] ** 2 / covariance[0, 0]
    assert policies.root[0, 1, 0, 0] ** 2 == pytest.approx(rest, rel=1e-5)


def test_curvature_of_the_dynamics_is_in_the_law():
    """Beside the mode of a pendulum the density is that of the policies, to second order."""
    passage = Passage(Pendulum(), np.array([2.0, 0.5]), Box([4.0, -0.3], [4.4, 0.1]), 8, 0.25)
    modes = find_modes(passage, 2, np.random.default_rng(0))
    policies, log_integral = riccati_policies(passage, modes)
    price = passage.goal_price(GOAL_SHARE)
    rng, distances = np.random.default_rng(1), []
    for scale in (0.01, 0.005):
        controls = policies.mean[0] + scale * rng.standard_normal((200, 8, 1))
        states = np.empty((200, 9, 2))
        states[:, 0] = passage.start
        for k in range(8):
            step = passage.integrator.step
            states[:, k + 1] = step(passage.system, states[:, k], controls[:, k], passage.dt)
        missed = np.square(states[:, -1] - modes.goals[0]) @ price
        log_density = passage.log_reward(states[:, :-1], controls) - missed
        rest = (controls - policies.means(0, states[:, :-1])) / policies.root[0, :, 0]
        log_gaussian = -np.sum(np.square(rest), axis=(1, 2)) / 2 - 4 * np.log(2 * np.pi)
        log_gaussian -= np.sum(np.log(policies.root[0]))
        distances.append(np.max(np.abs(log_density - log_integral[0] - log_gaussian)))
    # What is left is of third order: half the distance, an eighth.
    assert distances[1] < distances[0] / 6
    assert distances[0] < 1e-3


def test_a_refit_to_the_law_itself_changes_nothing_and_from_elsewhere_leads_there():
    bridge, policies, _ = bridge_and_policies(3)
    mean, covariance, _ = law_of_controls(bridge)
    rng, passage = np.random.default_rng(0), bridge.passage
    controls = rng.multivariate_normal(mean, covariance, 4000)[..., None]
    states = np.empty((4000, passage.steps + 1, 2))
    states[:, 0] = passage.start
    for k in range(passage.steps):
        of = passage.system, states[:, k], controls[:, k], passage.dt
        states[:, k + 1] = passage.integrator.step(*of)
    elsewhere = LocalPolicies(
        policies.mode, policies.states, policies.mean + 1.0, 0 * policies.gain, 2 * policies.root
    )
    for before in (policies, elsewhere):
        after = refit(before, states[:, :-1], controls, np.ones((4000, 1)), passage.limits)
        np.testing.assert_allclose(after.root, policies.root, rtol=0.1)
        gap = after.means(0, states[:, :-1]) - policies.means(0, states[:, :-1])
        assert np.sqrt(np.mean(np.square(gap / policies.root[0, :, 0]))) < 0.1


def test_a_refit_finds_a_policy_behind_a_limit():
    """A regression of limited controls would find less of everything."""
    rng, limits = np.random.default_rng(0), (np.array([-1.0]), np.array([0.8]))
    states = rng.normal(size=(20_000, 1, 2))
    wanted = 0.6 + states @ [0.5, -0.3] + 0.9 * rng.standard_normal((20_000, 1))
    kept = (wanted[:, 0] > -1.0) & (wanted[:, 0] < 0.8)
    one = np.ones((1, 1, 1))
    policies = LocalPolicies(
        np.array([0]), np.zeros((1, 1, 2)), 0 * one, np.zeros((1, 1, 1, 2)), 0.7 * one[..., None]
    )
    share = np.ones((np.sum(kept), 1))
    for _ in range(60):
        policies = refit(policies, states[kept], wanted[kept][..., None], share, limits)
    assert policies.mean[0, 0, 0] == pytest.approx(0.6, abs=0.1)
    np.testing.assert_allclose(policies.gain[0, 0, 0], [0.5, -0.3], atol=0.07)
    assert policies.root[0, 0, 0, 0] == pytest.approx(0.9, abs=0.1)
