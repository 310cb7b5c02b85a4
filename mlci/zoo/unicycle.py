"""x' = u_1 cos(heading), y' = u_1 sin(heading), heading' = u_2: a wheel that rolls and turns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System
from mlci.zoo.parts import limited_space, matrix, rates, require_positive, symmetric_box


@dataclass(frozen=True, eq=False)
class Unicycle(System):
    """A wheel in a plane, driven by its speed, forwards or backwards, and its rate of turn.

    Under constant controls it runs along a circle of radius u_1 / u_2.

    Attributes:
        position_limit: bound on |x| and |y| [m].
        speed_limit: bound on |u_1| [m/s].
        turn_limit: bound on |u_2| [rad/s].
    """

    position_limit: float = 3.0
    speed_limit: float = 2.0
    turn_limit: float = 2.0

    def __post_init__(self) -> None:
        require_positive(self)

    @cached_property
    def space(self) -> StateSpace:
        limits = self.position_limit, self.position_limit, None
        return limited_space(("x", "y", "heading"), ("m", "m", "rad"), limits)

    @cached_property
    def control_box(self) -> Box:
        return symmetric_box(self.speed_limit, self.turn_limit)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        heading, speed = states[..., 2], controls[..., 0]
        ahead, aside = speed * np.cos(heading), speed * np.sin(heading)
        return rates(states, controls, [ahead, aside, controls[..., 1]])

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        sine, cosine, speed = np.sin(states[..., 2]), np.cos(states[..., 2]), controls[..., 0]
        ahead, aside = speed * cosine, speed * sine
        by_state = matrix(states, controls, [[0, 0, -aside], [0, 0, ahead], [0, 0, 0]])
        return by_state, matrix(states, controls, [[cosine, 0], [sine, 0], [0, 1]])
