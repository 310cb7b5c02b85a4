"""Controls and rewards of paths whose controls are known, because they were made by them."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.demonstrations import Demonstration, Task, even_times
from mlci.inverse_dynamics import controls_along, path_reward
from mlci.simulate import RK4, rollout
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import FunctionSystem, Pendulum, System, TelescopingPendulum

PLANE = StateSpace(Box([-9, -9], [9, 9]), [False, False], ("x", "y"))
CUBIC = FunctionSystem(
    lambda x, u: (u[..., 0] ** 3 + u[..., 0], np.sin(x[..., 0]) * u[..., 1]),
    PLANE,
    Box([-1, -1], [1, 1]),
)


@pytest.mark.parametrize(
    ("system", "start", "beyond"),
    [
        (Pendulum(), [6.0, 1.0], 3.0),  # across the seam, with controls outside the box
        (TelescopingPendulum(), [0.1, 0.0, 8.0, 0.2], 1.0),
        (CUBIC, [1.0, 0.0], 1.0),
    ],
)
def test_controls_are_those_that_made_the_path(
    system: System, start: list[float], beyond: float
) -> None:
    rng = np.random.default_rng(0)
    box = system.control_box
    controls = beyond * rng.uniform(box.lower, box.upper, (40, box.dimension))
    path = rollout(system, start, controls, 0.02)
    # 1e-6: rounding of the path, 1e-15, over a time step squared is 1e-12 for a position's part.
    times = even_times(len(path), 0.02)
    assert controls_along(system, path, times) == pytest.approx(controls, abs=1e-6)
    wrapped = system.space.wrap(path)
    assert controls_along(system, wrapped, times) == pytest.approx(controls, abs=1e-6)


def test_controls_and_reward_of_uneven_times() -> None:
    """Each control is held for a time of its own; the reward is that of the same held controls."""
    system, rng = Pendulum(), np.random.default_rng(1)
    holds, held = rng.uniform(0.01, 0.05, 30), np.repeat([1.0, -2.0, 0.5], 10)
    holds *= np.repeat(0.5 / holds.reshape(3, 10).sum(axis=1), 10)
    states = [np.array([1.0, 0.0])]
    for control, hold in zip(held, holds, strict=True):
        states.append(RK4.step(system, states[-1], np.array([control]), hold))
    path, times = np.array(states), np.append(0.0, np.cumsum(holds))
    assert controls_along(system, path, times)[:, 0] == pytest.approx(held, abs=1e-6)
    reward = path_reward(system, Demonstration.from_path(path, times), 3)
    assert reward == pytest.approx(-(1.0 + 4.0 + 0.25) * 0.5, rel=1e-6)


def test_a_path_that_no_control_makes_has_the_nearest_one() -> None:
    """A robot that can move along x alone, and a path that also moves along y."""
    system = FunctionSystem(lambda x, u: (u[..., 0], 0.0), PLANE, Box([-1], [1]))
    path = np.column_stack([np.linspace(0, 1, 11), np.linspace(0, 2, 11)])
    assert controls_along(system, path, even_times(11, 0.1)) == pytest.approx(np.ones((10, 1)))


def demonstration(states: Floats, controls: Floats | None, dt: float) -> Demonstration:
    horizon = (len(states) - 1) * dt
    task = Task(states[0], Box.point(states[-1]), horizon)
    return Demonstration(task, states, controls, even_times(len(states), dt))


@pytest.mark.parametrize("known", [True, False])
def test_the_reward_of_held_controls_is_that_of_the_moves(known: bool) -> None:
    system, held = Pendulum(), np.array([[1.0], [-2.0], [0.5]])
    controls = np.repeat(held, 25, axis=0)
    path = rollout(system, [1.0, 0.0], controls, 0.02)
    reward = path_reward(system, demonstration(path, controls if known else None, 0.02), 3)
    assert reward == pytest.approx(-(1.0 + 4.0 + 0.25) * 0.5, rel=1e-6)


def test_controls_are_averaged_over_a_step_and_states_taken_where_it_begins() -> None:
    class Priced(FunctionSystem):
        def running_reward(self, states: Floats, controls: Floats) -> Floats:
            return -states[..., 0] - np.sum(controls**2, axis=-1)

    system = Priced(
        lambda x, u: (u[..., 0],), StateSpace(Box([-9], [9]), [False], ("x",)), Box([-1], [1])
    )
    controls = np.array([[1.0], [3.0], [-2.0], [0.0], [4.0]])
    path = rollout(system, [0.0], controls, 0.2)
    # Two steps of 0.5 s, each of two and a half samples: means (1 + 3 - 1) / 2.5 and 3 / 2.5, from
    # x = 0 and x = 0.2 * (1 + 3 - 1).
    expected = 0.5 * (-(1.2**2) - 0.6 - 1.2**2)
    assert path_reward(system, demonstration(path, controls, 0.2), 2) == pytest.approx(expected)
