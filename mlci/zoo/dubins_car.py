"""x' = v cos(heading), y' = v sin(heading), heading' = u: a car of one speed (Dubins 1957)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System
from mlci.zoo.parts import limited_space, matrix, rates, require_positive, symmetric_box


@dataclass(frozen=True, eq=False)
class DubinsCar(System):
    """A car that always drives forwards at one speed and chooses its rate of turn alone.

    Under constant u it runs along a circle of radius speed / u. All of its paths are equally long,
    so that tasks end where they must when the time is over, if need be by a detour.

    Attributes:
        position_limit: bound on |x| and |y| [m].
        turn_limit: bound on |u| [rad/s].
        speed: v [m/s].
    """

    position_limit: float = 3.0
    turn_limit: float = 2.0
    speed: float = 1.0

    def __post_init__(self) -> None:
        require_positive(self)

    @cached_property
    def space(self) -> StateSpace:
        limits = self.position_limit, self.position_limit, None
        return limited_space(("x", "y", "heading"), ("m", "m", "rad"), limits)

    @cached_property
    def control_box(self) -> Box:
        return symmetric_box(self.turn_limit)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        heading = states[..., 2]
        ahead, aside = self.speed * np.cos(heading), self.speed * np.sin(heading)
        return rates(states, controls, [ahead, aside, controls[..., 0]])

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        ahead, aside = (self.speed * f(states[..., 2]) for f in (np.cos, np.sin))
        by_state = matrix(states, controls, [[0, 0, -aside], [0, 0, ahead], [0, 0, 0]])
        return by_state, matrix(states, controls, [[0], [0], [1]])
