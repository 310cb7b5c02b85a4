"""A system of another strength: the other's motion and reward, and control ranges of its own."""

import numpy as np
import pytest

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import solve_safe_set
from mlci.spaces import Box, StateSpace
from mlci.strength import WithStrength
from mlci.systems import FunctionSystem, Pendulum, TelescopingPendulum


class Pricey(Pendulum):
    """A pendulum whose reward is its own: speed costs too, and twice of a rad/s at 0.5 rad/s^2."""

    def running_reward(self, states, controls):
        return -(controls[..., 0] ** 2) - 2 * states[..., 1] ** 2 * controls[..., 0]

    def reward_derivatives(self, states, controls):
        speed, control = np.broadcast_arrays(states[..., 1], controls[..., 0])
        zero = np.zeros(speed.shape)
        gradient = np.stack([zero, -4 * speed * control, -2 * control - 2 * speed**2], axis=-1)
        rows = [[zero, zero, zero], [zero, -4 * control, -4 * speed]]
        rows.append([zero, -4 * speed, zero - 2])
        return gradient, np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


SYSTEMS = [Pricey(gravity=9.81, length=0.7, drag=0.3, mass=2.0), TelescopingPendulum()]


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda system: type(system).__name__)
def test_it_moves_and_is_paid_as_the_other_is_by_the_same_controls(system):
    strong = WithStrength(system, 3.0)
    rng = np.random.default_rng(0)
    states = rng.normal(size=(7, 1, system.space.dimension))
    controls = 5 * rng.normal(size=(4, system.control_box.dimension))  # also out of either range
    assert strong.space is system.space
    np.testing.assert_array_equal(
        strong.dynamics(states, controls), system.dynamics(states, controls)
    )
    np.testing.assert_array_equal(
        strong.running_reward(states, controls), system.running_reward(states, controls)
    )
    for name in ("jacobians", "reward_derivatives"):
        for own, other in zip(
            getattr(strong, name)(states, controls),
            getattr(system, name)(states, controls),
            strict=True,
        ):
            np.testing.assert_array_equal(own, other)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_ends_of_the_control_ranges_are_multiplied_each_by_itself(factor):
    space = StateSpace(Box([-3.0], [3.0]), [False], ("x",), ("m",))
    uneven = FunctionSystem(lambda x, u: (u[..., 0] + u[..., 1],), space, Box([-1, 0], [4, 2]))
    box = WithStrength(uneven, factor).control_box
    np.testing.assert_array_equal(box.lower, [-factor, 0])
    np.testing.assert_array_equal(box.upper, [4 * factor, 2 * factor])
    np.testing.assert_array_equal(uneven.control_box.upper, [4, 2])


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_its_safe_set_is_that_of_a_system_built_with_those_limits(factor):
    system, built = Pendulum(), Pendulum(control_limit=2.0 * factor)
    grid, regions = (
        Grid(system.space, (31, 31)),
        Regions.from_boxes(system.space, [Box([3.0, -6.0], [3.6, 6.0])]),
    )
    strong, expected = (
        solve_safe_set(each, grid, regions) for each in (WithStrength(system, factor), built)
    )
    np.testing.assert_array_equal(strong.values, expected.values)


@pytest.mark.parametrize("factor", [0.0, -1.0, np.nan])
def test_a_strength_that_is_not_positive_is_refused(factor):
    with pytest.raises(ValueError, match=f"a strength must be positive, not {factor}"):
        WithStrength(Pendulum(), factor)
