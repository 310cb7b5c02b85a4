"""Reach of controls and expansion of the flow, against closed forms and integration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm

from mlci.demonstrations import Demonstration, Task, even_times
from mlci.grids import Grid
from mlci.outlook.flow import control_reach, flow_expansion
from mlci.simulate import rollout
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, FunctionSystem, Pendulum
from mlci.zoo.damped_spring import DampedSpring

DOOR = DampedSpring()
DRIFT, PUSH = np.array([[0.0, 1.0], [-DOOR.stiffness, -DOOR.damping]]), np.array([0.0, 1.0])


def test_the_reach_of_a_mass_is_a_parabola_by_the_cells() -> None:
    mass = DoubleIntegrator(position_limit=3.0, speed_limit=2.0)
    grid, dt = Grid(mass.space, (12, 8)), 0.5  # both kinds of cells are 0.5 wide
    reach = control_reach(mass, grid, Box([-1.0], [0.6]), dt)
    np.testing.assert_allclose(reach, [1.6 * dt**2 / 2 / 0.5, 1.6 * dt / 0.5], rtol=1e-12)


def test_the_reach_of_a_linear_system_is_an_integral() -> None:
    grid, dt = Grid(DOOR.space, (5, 7)), 0.1
    expected, _ = quad_vec(lambda s: expm(DRIFT * s) @ PUSH, 0.0, dt)
    reach = control_reach(DOOR, grid, DOOR.control_box, dt)
    # The series ends before (damping dt)^4 / 120 = 2e-4.
    np.testing.assert_allclose(reach, 12.0 * np.abs(expected) / grid.widths, rtol=1e-3)


def test_the_reach_is_the_mean_over_cells_where_controls_push_unequally() -> None:
    """x' = (1 + x) u: cells of [0, 4] are pushed by 3 on average, and by 4.5 at most."""
    space = StateSpace(Box([0.0], [4.0]), [False], ("x",))
    system = FunctionSystem(lambda x, u: ((1.0 + x[..., 0]) * u[..., 0],), space, Box([-1], [1]))
    reach = control_reach(system, Grid(space, (4,)), Box([-1.0], [1.0]), 0.1)
    np.testing.assert_allclose(reach, [2 * 3 * 0.1], rtol=1e-6)


def path_of(system, start, seconds: float, steps: int) -> Demonstration:
    controls = np.zeros((steps, 1))
    states = rollout(system, start, controls, seconds / steps)
    task = Task(states[0], Box.point(states[-1]), seconds)
    return Demonstration(task, states, controls, even_times(steps + 1, seconds / steps), "free")


def test_the_expansion_of_a_linear_system_is_the_norm_of_its_exponential() -> None:
    path, widths = path_of(DOOR, [1.0, 0.5], 2.0, 400), DOOR.space.bounds.widths
    expected = np.linalg.norm(expm(DRIFT * 2.0) * widths / widths[:, None], ord=2)
    assert flow_expansion(DOOR, path) == pytest.approx(np.log(expected), abs=1e-3)


def test_it_is_that_of_differences_between_paths() -> None:
    """Of the pendulum, which is not linear."""
    system, start, step = Pendulum(), np.array([0.4, 0.3]), 1e-5
    widths = system.space.bounds.widths
    ends = [
        rollout(system, start + nudge, np.zeros((800, 1)), 0.005)[-1]
        for nudge in [np.zeros(2), *np.diag(step * widths)]
    ]
    stretch = ((ends[1:] - np.array(ends[0])) / step / widths).T
    expected = np.log(np.linalg.norm(stretch, ord=2))
    assert flow_expansion(system, path_of(system, start, 4.0, 800)) == pytest.approx(
        expected,
        abs=6e-3,  # each step takes the slope at its start: the error is of order dt
    )


def test_steps_of_a_flow_follow_each_other() -> None:
    """Against differences, where what stretches first and what later does not commute."""
    box, widths = Box([-4.0, -4.0], [4.0, 2.0]), np.array([8.0, 6.0])
    space = StateSpace(box, [False, False], ("x", "y"))
    system = FunctionSystem(
        lambda x, u: (x[..., 0] * x[..., 1] + u[..., 0], 1.0 - x[..., 0]), space, Box([-1.0], [1.0])
    )
    start, step = np.array([0.2, -0.5]), 1e-5
    path = path_of(system, start, 2.0, 400)
    ends = [rollout(system, start + d, path.controls, 0.005)[-1] for d in np.diag(step * widths)]
    stretch = ((np.array(ends) - path.states[-1]) / step / widths).T
    expected = np.log(np.linalg.norm(stretch, ord=2))
    assert flow_expansion(system, path) == pytest.approx(expected, abs=6e-3)  # 0.5 more reversed


def test_a_path_without_controls_is_refused() -> None:
    path = replace(path_of(DOOR, [1.0, 0.5], 1.0, 10), controls=None)
    with pytest.raises(ValueError, match="free: the expansion of a flow needs controls and times"):
        flow_expansion(DOOR, path)
