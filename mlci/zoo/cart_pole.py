"""A cart on a rail with a pole on it, pushed by a force (Barto, Sutton and Anderson 1983)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System
from mlci.zoo.parts import limited_space, rates, require_positive, symmetric_box


@dataclass(frozen=True, eq=False)
class CartPole(System):
    """(M + m sin^2) x'' = u + m sin (l angle'^2 - g cos), l angle'' = g sin - cos x''.

    By Lagrange's equations, with the pole's mass at its tip; angle = 0 is upright. The control is
    a force by the cart's mass: M = 1.

    Attributes:
        position_limit: bound on |x| [m].
        angle_limit: bound on |angle| [rad].
        speed_limit: bound on |x'| [m/s].
        angular_speed_limit: bound on |angle'| [rad/s].
        control_limit: bound on |u| [m/s^2].
        mass: m, as a multiple of the cart's.
        length: l [m].
        gravity: g [m/s^2].
    """

    position_limit: float = 2.0
    angle_limit: float = 1.0
    speed_limit: float = 2.0
    angular_speed_limit: float = 2.0
    control_limit: float = 3.0
    mass: float = 0.1
    length: float = 1.0
    gravity: float = 1.0

    def __post_init__(self) -> None:
        require_positive(self)

    @cached_property
    def space(self) -> StateSpace:
        places, speeds = (self.position_limit, self.angle_limit), self.speed_limit
        names = "position", "angle", "velocity", "angular_velocity"
        limits = *places, speeds, self.angular_speed_limit
        return limited_space(names, ("m", "rad", "m/s", "rad/s"), limits)

    @cached_property
    def control_box(self) -> Box:
        return symmetric_box(self.control_limit)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        sine, cosine, swing = np.sin(states[..., 1]), np.cos(states[..., 1]), states[..., 3]
        pull = self.mass * sine * (self.length * swing**2 - self.gravity * cosine)
        push = (controls[..., 0] + pull) / (1 + self.mass * sine**2)
        fall = (self.gravity * sine - cosine * push) / self.length
        return rates(states, controls, [states[..., 2], swing, push, fall])
