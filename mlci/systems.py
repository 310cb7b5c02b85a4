"""Continuous control systems x' = h(x, u): the state space, the control box and the reward."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mlci.differences import first_derivatives, second_derivatives
from mlci.spaces import Box, Floats, StateSpace


class System(ABC):
    """What the rest of the package needs to know about a system.

    `control_box` is the range that the tabular actions and the safety control use. The
    demonstrator is free to exceed it. `check_system` tells what is wrong with one.
    """

    @property
    @abstractmethod
    def space(self) -> StateSpace:
        """The state space, whose bounds the tabular model may not leave."""

    @property
    @abstractmethod
    def control_box(self) -> Box:
        """(m,) range of the controls."""

    @abstractmethod
    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        """h(x, u): states (..., n) and controls (..., m) to derivatives (..., n).

        The leading shapes of states and controls may be any that broadcast.
        """

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        """dh/dx (..., n, n) and dh/du (..., n, m); central differences unless a system knows."""
        return central_differences(self, states, controls)

    def running_reward(self, states: Floats, controls: Floats) -> Floats:
        """r(x, u) (...,) at temperature 1: minus the squared control, as in (8).

        The tabular agent and the demonstrator both maximise it. It repeats where a dimension does.
        """
        squares = np.square(controls)  # added one by one: sums along so short an axis are slow
        return -sum((squares[..., d] for d in range(1, squares.shape[-1])), squares[..., 0])

    def reward_derivatives(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        """Gradient (..., n + m) and Hessian (..., n + m, n + m) of r in (x, u).

        Exact for the reward above, which is a quadratic; central differences for a system's own,
        unless it knows.
        """
        if type(self).running_reward is not System.running_reward:
            return reward_differences(self, states, controls)
        n, m = states.shape[-1], controls.shape[-1]
        gradient = np.zeros((*np.broadcast_shapes(states.shape[:-1], controls.shape[:-1]), n + m))
        gradient[..., n:] = -2 * controls
        hessian = np.diag(np.append(np.zeros(n), np.full(m, -2.0)))
        return gradient, np.broadcast_to(hessian, (*gradient.shape, n + m))


def central_differences(system: System, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
    """dh/dx (..., n, n) and dh/du (..., n, m) by differences."""
    return (
        first_derivatives(lambda moved: system.dynamics(moved, controls), states),
        first_derivatives(lambda moved: system.dynamics(states, moved), controls),
    )


def reward_differences(system: System, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
    """Gradient (..., n + m) and Hessian (..., n + m, n + m) of r in (x, u) by differences."""
    n, batch = states.shape[-1], np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])
    parts = [np.broadcast_to(part, (*batch, part.shape[-1])) for part in (states, controls)]
    point = np.concatenate(parts, axis=-1)

    def reward(z: Floats) -> Floats:
        """r (...,), which may depend on states or controls alone."""
        return np.broadcast_to(system.running_reward(z[..., :n], z[..., n:]), batch)

    gradient = first_derivatives(lambda z: reward(z)[..., None], point)[..., 0, :]
    return gradient, second_derivatives(reward, point)


@dataclass(frozen=True, eq=False)
class FunctionSystem(System):
    """A system from a function that gives the rate of each dimension.

    Attributes:
        rates: takes states (..., n) and controls (..., m), and returns n rates, each (...,) or a
            number, such as `lambda x, u: (x[..., 1], u[..., 0])`.
        state_space: the state space.
        control_range: (m,) range of the controls.
    """

    rates: Callable[[Floats, Floats], Sequence[ArrayLike]]
    state_space: StateSpace
    control_range: Box

    @property
    def space(self) -> StateSpace:
        return self.state_space

    @property
    def control_box(self) -> Box:
        return self.control_range

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        batch = np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])
        return _stacked(batch, self.rates(states, controls))


@dataclass(frozen=True, eq=False)
class Pendulum(System):
    """theta'' = g / l sin(theta) + u, equation (7); theta = 0 is upright.

    With drag and another mass it is g / l sin(theta) - drag theta' + u / mass.

    Attributes:
        speed_limit: bound on |theta'| [rad/s].
        control_limit: bound on |u| [rad/s^2].
        gravity: g [m/s^2].
        length: l [m].
        drag: what slows it down [1/s].
        mass: as a multiple of the mass that u accelerates by u.
    """

    speed_limit: float = 6.0
    control_limit: float = 2.0
    gravity: float = 1.0
    length: float = 1.0
    drag: float = 0.0
    mass: float = 1.0

    def __post_init__(self) -> None:
        _require_positive(self, "speed_limit", "control_limit", "length", "mass")

    @cached_property
    def space(self) -> StateSpace:
        bounds = Box(np.array([0.0, -self.speed_limit]), np.array([2 * np.pi, self.speed_limit]))
        return StateSpace(
            bounds, np.array([True, False]), ("angle", "angular_velocity"), ("rad", "rad/s")
        )

    @cached_property
    def control_box(self) -> Box:
        return Box(np.array([-self.control_limit]), np.array([self.control_limit]))

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        passive = self.gravity / self.length * np.sin(states[..., 0]) - self.drag * states[..., 1]
        acceleration = passive + controls[..., 0] / self.mass
        return _stacked(acceleration.shape, [states[..., 1], acceleration])

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        batch = np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])
        by_state = np.zeros((*batch, 2, 2))
        by_state[..., 0, 1] = 1.0
        by_state[..., 1, 0] = self.gravity / self.length * np.cos(states[..., 0])
        by_state[..., 1, 1] = -self.drag
        by_control = np.broadcast_to(np.array([[0.0], [1 / self.mass]]), (*batch, 2, 1))
        return by_state, by_control


@dataclass(frozen=True, eq=False)
class TelescopingPendulum(System):
    """theta'' = g / l sin(theta) + u_1, l'' = u_2 (section VI); theta = 0 is upright.

    A person who stands up or sits down: a mass on a leg of varying length, which leans but does not
    go round. Lengths are in decimetres, in which the two controls cost alike (conf/system).

    Attributes:
        angle_limit: bound on |theta| [rad].
        angular_speed_limit: bound on |theta'| [rad/s].
        shortest: least l [dm].
        longest: greatest l [dm].
        speed_limit: bound on |l'| [dm/s].
        torque_limit: bound on |u_1| [rad/s^2].
        force_limit: bound on |u_2| [dm/s^2].
        gravity: g [dm/s^2].
    """

    angle_limit: float = 1.2
    angular_speed_limit: float = 2.0
    shortest: float = 5.0
    longest: float = 11.0
    speed_limit: float = 3.0
    torque_limit: float = 2.0
    force_limit: float = 3.0
    gravity: float = 10.0

    def __post_init__(self) -> None:
        _require_positive(
            self,
            "angle_limit",
            "angular_speed_limit",
            "shortest",
            "longest",
            "speed_limit",
            "torque_limit",
            "force_limit",
        )
        if not self.shortest < self.longest:
            raise ValueError(
                f"TelescopingPendulum.shortest must be below longest, not {self.shortest} and "
                f"{self.longest}"
            )

    @cached_property
    def space(self) -> StateSpace:
        most = [self.angle_limit, self.angular_speed_limit, self.longest, self.speed_limit]
        least = [-self.angle_limit, -self.angular_speed_limit, self.shortest, -self.speed_limit]
        return StateSpace(
            Box(np.array(least), np.array(most)),
            np.zeros(4, dtype=bool),
            ("angle", "angular_velocity", "length", "velocity"),
            ("rad", "rad/s", "dm", "dm/s"),
        )

    @cached_property
    def control_box(self) -> Box:
        most = np.array([self.torque_limit, self.force_limit])
        return Box(-most, most)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        fall = self.gravity / states[..., 2] * np.sin(states[..., 0])
        swing = fall + controls[..., 0]
        return _stacked(swing.shape, [states[..., 1], swing, states[..., 3], controls[..., 1]])

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        batch = np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])
        angle, length = states[..., 0], states[..., 2]
        by_state = np.zeros((*batch, 4, 4))
        by_state[..., 0, 1] = by_state[..., 2, 3] = 1.0
        by_state[..., 1, 0] = self.gravity / length * np.cos(angle)
        by_state[..., 1, 2] = -self.gravity / length**2 * np.sin(angle)
        push = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
        return by_state, np.broadcast_to(push, (*batch, 4, 2))


@dataclass(frozen=True, eq=False)
class DoubleIntegrator(System):
    """x'' = u: a mass on a line, whose safe sets and optimal controls are known exactly.

    Attributes:
        position_limit: bound on |x| [m].
        speed_limit: bound on |x'| [m/s].
        control_limit: bound on |u| [m/s^2].
    """

    position_limit: float = 3.0
    speed_limit: float = 3.0
    control_limit: float = 1.0

    def __post_init__(self) -> None:
        _require_positive(self, "position_limit", "speed_limit", "control_limit")

    @cached_property
    def space(self) -> StateSpace:
        upper = np.array([self.position_limit, self.speed_limit])
        return StateSpace(
            Box(-upper, upper), np.array([False, False]), ("position", "velocity"), ("m", "m/s")
        )

    @cached_property
    def control_box(self) -> Box:
        return Box(np.array([-self.control_limit]), np.array([self.control_limit]))

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        batch = np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])
        return _stacked(batch, [states[..., 1], controls[..., 0]])

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        batch = np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])
        by_state = np.broadcast_to(np.array([[0.0, 1.0], [0.0, 0.0]]), (*batch, 2, 2))
        by_control = np.broadcast_to(np.array([[0.0], [1.0]]), (*batch, 2, 1))
        return by_state, by_control


def _stacked(batch: tuple[int, ...], rates: Sequence[ArrayLike]) -> Floats:
    """Rates (*batch, n) of n dimensions, each contiguous: numpy is slow along so short an axis."""
    rows = np.empty((len(rates), *batch))
    for d, rate in enumerate(rates):
        rows[d] = rate
    return rows.transpose(*range(1, rows.ndim), 0)


def _require_positive(system: System, *names: str) -> None:
    """Refuse a parameter that is not a positive finite number."""
    for name in names:
        value = getattr(system, name)
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{type(system).__name__}.{name} must be positive, not {value}")
