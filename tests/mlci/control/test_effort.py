"""A system that moves as another does, with prices of its own on squared states and controls."""

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from mlci.control.effort import WithEffort
from mlci.control.ilqr import optimize
from mlci.demonstrator import sample_trials
from mlci.simulate import RK4, euler_step
from mlci.spaces import Box
from mlci.system_check import check_system
from mlci.systems import DoubleIntegrator, Pendulum, TelescopingPendulum, reward_differences

PENDULUM = Pendulum()


def test_the_system_keeps_all_promises_of_one() -> None:
    check_system(WithEffort(TelescopingPendulum(), np.array([0.5, 1.0, 0.0, 2.0, 0.0, 3.0])))


def test_reward_is_the_other_one_minus_prices_of_squares() -> None:
    rng = np.random.default_rng(0)
    states, controls = rng.normal(size=(7, 1, 4)), rng.normal(size=(5, 2))
    price = np.array([0.5, 1.0, 0.0, 2.0, 0.0, 3.0])
    system = WithEffort(TelescopingPendulum(), price)
    for i, j in np.ndindex(7, 5):
        by_hand = sum(p * z**2 for p, z in zip(price, [*states[i, 0], *controls[j]], strict=True))
        expected = -np.sum(controls[j] ** 2) - by_hand
        assert system.running_reward(states, controls)[i, j] == pytest.approx(expected, rel=1e-12)
    for exact, differences in zip(
        system.reward_derivatives(states, controls),
        reward_differences(system, states, controls),
        strict=True,
    ):
        np.testing.assert_allclose(
            np.broadcast_to(exact, differences.shape), differences, atol=1e-5
        )


def test_prices_of_the_wrong_kind_are_refused() -> None:
    with pytest.raises(ValueError, match=r"an effort needs 3 prices, not \[1.0, 2.0\]"):
        WithEffort(PENDULUM, np.array([1.0, 2.0]))
    with pytest.raises(ValueError, match="goes round jumps"):
        WithEffort(PENDULUM, np.array([1.0, 0.0, 0.0]))


def test_demonstrator_finds_the_optimum_of_a_priced_speed() -> None:
    """x'' = u from rest at 0 to rest at 1 in 4 s, price 2 on the speed, by Pontryagin."""
    system = WithEffort(DoubleIntegrator(), np.array([0.0, 2.0, 0.0]))

    def motion(_t: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Of x, x' and the costates of u^2 + 2 x'^2, where u = -q / 2."""
        _, v, p, q = z
        return np.array([v, -q / 2, 0 * p, -p - 4 * v])

    def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.array([a[0], a[1], b[0] - 1, b[1]])

    times = np.linspace(0, 4, 401)
    exact = solve_bvp(motion, ends, times, np.zeros((4, 401)), tol=1e-8)
    start, goal = np.zeros((1, 2)), np.array([[1.0, 0.0]])
    solution = optimize(
        system, start, goal, goal, np.zeros((1, 400, 1)), 0.01, iterations=5, integrator=RK4
    )
    # The goal is held by a price of 300, so that it is missed by about a thousandth.
    np.testing.assert_allclose(solution.states[0], exact.sol(times)[:2].T, atol=5e-3)


def test_noise_moves_the_path_and_feedback_brings_it_to_the_goal() -> None:
    rng = np.random.default_rng(1)
    starts, goals = np.zeros((40, 2)), np.tile([1.0, 0.0], (40, 1))
    guesses, noise = np.zeros((40, 200, 1)), rng.normal(0, 0.1 / np.sqrt(0.01), (40, 200, 1))
    system = DoubleIntegrator()
    quiet, noisy = (
        optimize(system, starts, goals, goals, guesses, 0.01, noise=each) for each in (None, noise)
    )
    states = starts
    for k in range(200):  # what is recorded is what the controls do
        states = euler_step(system, states, noisy.controls[:, k], 0.01)
        np.testing.assert_allclose(states, noisy.states[:, k + 1], atol=1e-10)
    blind = starts
    for k in range(200):
        blind = euler_step(system, blind, quiet.controls[:, k] + noise[:, k], 0.01)
    off = np.std(blind - goals, axis=0)
    # A random walk of 0.1 in the speed, and its integral: 0.1 sqrt(2^3 / 3) and 0.1 sqrt(2). Two
    # standard errors of 40 paths are 22 %.
    np.testing.assert_allclose(off, [0.163, 0.141], rtol=0.35)
    assert np.all(np.std(noisy.states[:, -1] - goals, axis=0) < [0.01, 0.03])
    middle = noisy.states[:, 100] - quiet.states[:, 100]
    assert np.all(np.std(middle, axis=0) > 0.01)
    same = optimize(system, starts, goals, goals, guesses, 0.01, noise=0 * noise)
    np.testing.assert_allclose(same.states, quiet.states, atol=1e-12)


def test_noise_of_a_trial_is_white_and_its_own() -> None:
    options = {"seed": 3, "horizon": 5.0, "dt": 0.02}
    box = Box(np.array([0.0, -2.0]), np.array([6.0, 2.0]))
    trials = sample_trials(PENDULUM, None, box, trials=30, control_noise=[0.3], **options)
    plain = sample_trials(PENDULUM, None, box, trials=30, **options)
    assert all(trial.noise is None for trial in plain)
    assert np.array_equal(trials[4].task.start, plain[4].task.start)
    assert np.array_equal(trials[4].guesses, plain[4].guesses)
    noise = np.array([trial.noise for trial in trials])
    assert noise.shape == (30, 250, 1)
    # 7500 samples: four standard errors of a standard deviation are 3.3 %.
    assert np.std(noise) * np.sqrt(0.02) == pytest.approx(0.3, rel=0.033)
    assert len(np.unique(noise)) == noise.size
