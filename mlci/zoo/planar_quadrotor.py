"""A quadrotor in a vertical plane: it climbs along its axis, and tilts to go aside."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System
from mlci.zoo.parts import limited_space, rates, require_positive, symmetric_box


@dataclass(frozen=True, eq=False)
class PlanarQuadrotor(System):
    """x'' = -(g + u_1) sin(tilt), z'' = (g + u_1) cos(tilt) - g, tilt'' = u_2.

    Controls are measured from hovering, so that hovering costs nothing; u_1 = -g is free fall.

    Attributes:
        position_limit: bound on |x| and |z| [m].
        tilt_limit: bound on |tilt| [rad].
        speed_limit: bound on |x'| and |z'| [m/s].
        spin_limit: bound on |tilt'| [rad/s].
        thrust_limit: bound on |u_1| [m/s^2].
        turn_limit: bound on |u_2| [rad/s^2].
        gravity: g [m/s^2].
    """

    position_limit: float = 2.0
    tilt_limit: float = 0.8
    speed_limit: float = 2.0
    spin_limit: float = 2.0
    thrust_limit: float = 2.0
    turn_limit: float = 3.0
    gravity: float = 9.81

    def __post_init__(self) -> None:
        require_positive(self)

    @cached_property
    def space(self) -> StateSpace:
        place, speed = (self.position_limit,) * 2, (self.speed_limit,) * 2
        names = "x", "z", "tilt", "velocity_x", "velocity_z", "spin"
        limits = *place, self.tilt_limit, *speed, self.spin_limit
        return limited_space(names, ("m", "m", "rad", "m/s", "m/s", "rad/s"), limits)

    @cached_property
    def control_box(self) -> Box:
        return symmetric_box(self.thrust_limit, self.turn_limit)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        thrust, tilt = self.gravity + controls[..., 0], states[..., 2]
        force = -thrust * np.sin(tilt), thrust * np.cos(tilt) - self.gravity
        speeds = [states[..., d] for d in (3, 4, 5)]
        return rates(states, controls, [*speeds, *force, controls[..., 1]])
