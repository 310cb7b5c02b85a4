import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mlci.differences import first_derivatives
from mlci.simulate import EULER, RK4, euler_step, in_substeps, rk4_step, rollout, step_count
from mlci.systems import Pendulum, TelescopingPendulum

PENDULUM = Pendulum()
START = np.array([1.0, -0.5])
CONTROLS = np.array([[1.5], [-2.0], [0.3], [1.0]])
HOLD = 0.5


def reference(start: np.ndarray) -> np.ndarray:
    """States (K+1, n) at the ends of the holds, by an adaptive method with tight tolerances."""
    states = [start]
    for control in CONTROLS:
        path = solve_ivp(
            lambda _, state, control=control: PENDULUM.dynamics(state, control),
            (0.0, HOLD),
            states[-1],
            method="DOP853",
            rtol=1e-13,
            atol=1e-13,
        )
        states.append(path.y[:, -1])
    return np.array(states)


@pytest.mark.parametrize(
    ("step", "order", "substeps"),
    [(euler_step, 1, [64, 128, 256, 512]), (rk4_step, 4, [2, 4, 8, 16])],
)
def test_error_falls_with_the_integrators_order(step, order, substeps):
    exact = reference(START)
    errors = []
    for count in substeps:
        path = rollout(PENDULUM, START, CONTROLS, HOLD, substeps=count, step=step)
        assert path.shape == (len(CONTROLS) * count + 1, 2)
        errors.append(np.max(np.abs(path[::count] - exact)))
    slope = -np.polyfit(np.log(substeps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.15)


def test_a_step_takes_rates_that_are_known():
    control, rates = CONTROLS[0], PENDULUM.dynamics(START, CONTROLS[0])
    step = rk4_step(PENDULUM, START, control, 0.1)
    np.testing.assert_array_equal(rk4_step(PENDULUM, START, control, 0.1, rates), step)
    assert not np.allclose(rk4_step(PENDULUM, START, control, 0.1, 0 * rates), step)


def test_substeps_are_those_of_a_rollout():
    path = rollout(PENDULUM, START, CONTROLS[:1], HOLD, substeps=3)
    step = in_substeps(RK4, 3).step(PENDULUM, START, CONTROLS[0], HOLD)
    np.testing.assert_allclose(step, path[-1], rtol=1e-14)


@pytest.mark.parametrize(
    "integrator", [EULER, RK4, in_substeps(RK4, 3)], ids=["Euler", "Runge-Kutta", "substeps"]
)
def test_jacobians_of_a_step_are_those_that_differences_give(integrator):
    leg, rng, dt = TelescopingPendulum(), np.random.default_rng(1), 0.3
    states = rng.uniform(leg.space.bounds.lower, leg.space.bounds.upper, (20, 4))
    controls = rng.uniform(-2, 2, (20, 2))
    by_state, by_control = integrator.rate_jacobians(leg, states, controls, dt)
    np.testing.assert_allclose(
        np.eye(4) + dt * by_state,
        first_derivatives(lambda moved: integrator.step(leg, moved, controls, dt), states),
        atol=1e-8,
    )
    np.testing.assert_allclose(
        dt * by_control,
        first_derivatives(lambda moved: integrator.step(leg, states, moved, dt), controls),
        atol=1e-8,
    )


def test_the_paths_of_a_batch_are_those_of_its_members():
    starts = START + np.random.default_rng(0).normal(size=(3, 1, 2))
    controls = np.stack([CONTROLS, -CONTROLS])
    paths = rollout(PENDULUM, starts, controls, HOLD, substeps=2)
    assert paths.shape == (3, 2, 9, 2)
    for i in range(3):
        for j in range(2):
            alone = rollout(PENDULUM, starts[i, 0], controls[j], HOLD, substeps=2)
            np.testing.assert_allclose(paths[i, j], alone, atol=1e-14)


def test_a_winding_path_is_not_wrapped():
    path = rollout(PENDULUM, [0.0, 5.0], np.zeros((40, 1)), 0.1)
    assert path[-1, 0] > 2 * np.pi
    assert np.all(np.diff(path[:, 0]) > 0)


def test_no_controls_make_a_path_of_one_state():
    np.testing.assert_array_equal(rollout(PENDULUM, START, np.empty((0, 1)), HOLD), [START])


def test_step_count_refuses_a_step_that_does_not_divide() -> None:
    assert step_count(5.0, 0.1) == 50
    with pytest.raises(ValueError, match="does not divide the horizon"):
        step_count(5.0, 0.3)
