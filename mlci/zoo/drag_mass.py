"""x'' = u - c |x'| x': a mass on a line in water, which slows down by its speed squared."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System
from mlci.zoo.parts import limited_space, matrix, rates, require_positive, symmetric_box


@dataclass(frozen=True, eq=False)
class DragMass(System):
    """A mass with quadratic drag: from rest, x' = sqrt(u / c) tanh(sqrt(u c) t) under constant u.

    Attributes:
        position_limit: bound on |x| [m].
        speed_limit: bound on |x'| [m/s].
        control_limit: bound on |u| [m/s^2].
        drag: c [1/m].
    """

    position_limit: float = 3.0
    speed_limit: float = 2.0
    control_limit: float = 1.5
    drag: float = 0.5

    def __post_init__(self) -> None:
        require_positive(self)

    @cached_property
    def space(self) -> StateSpace:
        limits = self.position_limit, self.speed_limit
        return limited_space(("position", "velocity"), ("m", "m/s"), limits)

    @cached_property
    def control_box(self) -> Box:
        return symmetric_box(self.control_limit)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        speed = states[..., 1]
        acceleration = controls[..., 0] - self.drag * np.abs(speed) * speed
        return rates(states, controls, [speed, acceleration])

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        slowing = -2 * self.drag * np.abs(states[..., 1])
        by_state = matrix(states, controls, [[0, 1], [0, slowing]])
        return by_state, matrix(states, controls, [[0], [1]])
