import numpy as np
import pytest

from mlci.simulate import rollout
from mlci.systems import (
    DoubleIntegrator,
    Pendulum,
    System,
    TelescopingPendulum,
    reward_differences,
)

SYSTEMS = [Pendulum(gravity=9.81, length=0.7), DoubleIntegrator(), TelescopingPendulum()]


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: type(system).__name__)
def test_jacobians_agree_with_central_differences(system):
    rng = np.random.default_rng(0)
    n, m = system.space.dimension, system.control_box.dimension
    states, controls = rng.normal(size=(5, 1, n)), rng.normal(size=(3, m))
    by_state, by_control = system.jacobians(states, controls)
    assert by_state.shape == (5, 3, n, n)
    assert by_control.shape == (5, 3, n, m)
    step = 1e-5
    for d, nudge in enumerate(step * np.eye(n)):
        change = system.dynamics(states + nudge, controls) - system.dynamics(
            states - nudge, controls
        )
        np.testing.assert_allclose(by_state[..., d], change / (2 * step), atol=1e-8)
    for d, nudge in enumerate(step * np.eye(m)):
        change = system.dynamics(states, controls + nudge) - system.dynamics(
            states, controls - nudge
        )
        np.testing.assert_allclose(by_control[..., d], change / (2 * step), atol=1e-8)


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: type(system).__name__)
def test_jacobians_that_a_system_leaves_out_are_those_that_it_would_give(system):
    rng = np.random.default_rng(1)
    n, m = system.space.dimension, system.control_box.dimension
    bounds = system.space.bounds
    states = rng.uniform(bounds.lower, bounds.upper, size=(50, 1, n))
    controls = 3 * rng.normal(size=(4, m))
    for given, known in zip(
        System.jacobians(system, states, controls),
        system.jacobians(states, controls),
        strict=True,
    ):
        np.testing.assert_allclose(given, known, rtol=0, atol=2e-9 * max(1, np.abs(known).max()))


def test_a_free_pendulum_keeps_its_energy_and_falls_from_upright():
    pendulum = Pendulum(gravity=3.0, length=0.5)
    path = rollout(pendulum, [0.1, 0.0], np.zeros((200, 1)), 0.01)
    energy = path[:, 1] ** 2 / 2 + 3.0 / 0.5 * np.cos(path[:, 0])
    np.testing.assert_allclose(energy, energy[0], atol=1e-6)
    assert path[-1, 0] > np.pi / 2


def test_a_double_integrator_under_constant_control_follows_a_parabola():
    path = rollout(DoubleIntegrator(), [0.3, -1.0], np.full((10, 1), 0.8), 0.1)
    time = np.linspace(0, 1, 11)
    expected = np.stack([0.3 - time + 0.4 * time**2, 0.8 * time - 1.0], axis=-1)
    np.testing.assert_allclose(path, expected, atol=1e-12)


def test_parameters_set_the_state_space_and_the_control_box():
    pendulum = Pendulum(speed_limit=4.0, control_limit=1.5)
    np.testing.assert_array_equal(pendulum.space.bounds.upper, [2 * np.pi, 4.0])
    np.testing.assert_array_equal(pendulum.space.periodic, [True, False])
    np.testing.assert_array_equal(pendulum.control_box.vertices(), [[-1.5], [1.5]])
    mass = DoubleIntegrator(position_limit=5.0, speed_limit=2.0, control_limit=0.5)
    np.testing.assert_array_equal(mass.space.bounds.vertices()[[0, 3]], [[-5, -2], [5, 2]])
    np.testing.assert_array_equal(mass.control_box.vertices(), [[-0.5], [0.5]])
    leg = TelescopingPendulum(angle_limit=1.0, shortest=4.0, longest=8.0, force_limit=0.5)
    np.testing.assert_array_equal(leg.space.bounds.lower, [-1, -2, 4, -3])
    np.testing.assert_array_equal(leg.space.bounds.upper, [1, 2, 8, 3])
    np.testing.assert_array_equal(leg.control_box.upper, [2, 0.5])
    assert not leg.space.periodic.any()


def test_a_telescoping_pendulum_of_constant_length_is_a_pendulum():
    telescope, pendulum = TelescopingPendulum(gravity=3.0), Pendulum(gravity=3.0, length=6.5)
    torques = np.linspace(-1, 1, 50)[:, None]
    path = rollout(telescope, [0.2, -0.3, 6.5, 0.0], np.hstack([torques, 0 * torques]), 0.05)
    expected = rollout(pendulum, [0.2, -0.3], torques, 0.05)
    np.testing.assert_allclose(path[:, :2], expected, atol=1e-12)
    np.testing.assert_array_equal(path[:, 2:], np.tile([6.5, 0.0], (51, 1)))


def test_a_leg_lengthens_under_a_constant_force_whatever_the_angle():
    forces = np.tile([0.7, 2.0], (20, 1))
    path = rollout(TelescopingPendulum(), [0.4, 0.5, 5.5, -1.0], forces, 0.1)
    time = np.linspace(0, 2, 21)
    np.testing.assert_allclose(path[:, 2], 5.5 - time + time**2, atol=1e-12)
    np.testing.assert_allclose(path[:, 3], 2.0 * time - 1.0, atol=1e-12)


def test_running_reward_is_minus_the_squared_control():
    reward = Pendulum().running_reward(np.zeros((2, 2)), np.array([[3.0], [-0.5]]))
    np.testing.assert_array_equal(reward, [-9.0, -0.25])


@pytest.mark.parametrize(
    ("make", "parameter"),
    [
        (Pendulum, "speed_limit"),
        (Pendulum, "control_limit"),
        (Pendulum, "length"),
        (DoubleIntegrator, "position_limit"),
        (DoubleIntegrator, "speed_limit"),
        (DoubleIntegrator, "control_limit"),
        *((TelescopingPendulum, f"{name}_limit") for name in ("angle", "angular_speed", "speed")),
        *((TelescopingPendulum, name) for name in ("torque_limit", "force_limit")),
        *((TelescopingPendulum, name) for name in ("shortest", "longest")),
    ],
)
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_parameters_that_are_not_positive_are_refused(make, parameter, value):
    message = rf"{make.__name__}\.{parameter} must be positive, not {value}"
    with pytest.raises(ValueError, match=message):
        make(**{parameter: value})


def test_a_leg_that_cannot_lengthen_is_refused():
    with pytest.raises(ValueError, match=r"shortest must be below longest, not 5\.0 and 5\.0"):
        TelescopingPendulum(longest=5.0)


class Curved(Pendulum):
    """A reward whose derivatives are known, and leaves none of them out."""

    def running_reward(self, states, controls):
        return np.sin(states[..., 0]) * controls[..., 0] - states[..., 1] ** 3

    def exact(self, states, controls):
        sine, cosine = np.sin(states[..., 0]), np.cos(states[..., 0])
        speed, u = np.broadcast_arrays(states[..., 1], controls[..., 0])
        gradient = np.stack(np.broadcast_arrays(cosine * u, -3 * speed**2, sine), axis=-1)
        hessian = np.zeros((*gradient.shape, 3))
        hessian[..., 0, 0], hessian[..., 1, 1] = -sine * u, -6 * speed
        hessian[..., 0, 2] = hessian[..., 2, 0] = cosine
        return gradient, hessian


def test_derivatives_of_a_reward_are_differences_unless_it_is_the_default():
    rng = np.random.default_rng(2)
    states, controls = rng.normal(size=(40, 1, 2)), rng.normal(size=(4, 1))
    gradient, hessian = Curved().reward_derivatives(states, controls)
    known = Curved().exact(states, controls)
    np.testing.assert_allclose(gradient, known[0], rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(hessian, known[1], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: type(system).__name__)
def test_derivatives_of_the_default_reward_are_exact(system):
    rng = np.random.default_rng(3)
    n, m = system.space.dimension, system.control_box.dimension
    states, controls = rng.normal(size=(5, 1, n)), rng.normal(size=(3, m))
    gradient, hessian = system.reward_derivatives(states, controls)
    for array, differences in zip(
        (gradient, hessian), reward_differences(system, states, controls), strict=True
    ):
        np.testing.assert_allclose(array, differences, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(gradient[..., n:], np.broadcast_to(-2 * controls, (5, 3, m)))
    assert not gradient[..., :n].any()
    assert set(hessian.ravel()) == {0.0, -2.0}
