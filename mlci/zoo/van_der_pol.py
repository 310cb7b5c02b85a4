"""x'' = mu (1 - x^2) x' - x + u: an oscillator that keeps itself going."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System
from mlci.zoo.parts import limited_space, matrix, rates, require_positive, symmetric_box


@dataclass(frozen=True, eq=False)
class VanDerPol(System):
    """Van der Pol's oscillator: all paths without control end in one limit cycle, |x| up to 2.

    Attributes:
        position_limit: bound on |x|, without a unit as the whole equation is.
        speed_limit: bound on |x'| [1/s].
        control_limit: bound on |u| [1/s^2].
        mu: how strongly the cycle attracts [1/s].
    """

    position_limit: float = 3.0
    speed_limit: float = 4.0
    control_limit: float = 2.0
    mu: float = 1.0

    def __post_init__(self) -> None:
        require_positive(self)

    @cached_property
    def space(self) -> StateSpace:
        limits = self.position_limit, self.speed_limit
        return limited_space(("position", "velocity"), ("", "1/s"), limits)

    @cached_property
    def control_box(self) -> Box:
        return symmetric_box(self.control_limit)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        position, speed = states[..., 0], states[..., 1]
        drive = self.mu * (1 - position**2) * speed - position
        return rates(states, controls, [speed, drive + controls[..., 0]])

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        position, speed = states[..., 0], states[..., 1]
        drive = [-2 * self.mu * position * speed - 1, self.mu * (1 - position**2)]
        by_state = matrix(states, controls, [[0, 1], drive])
        return by_state, matrix(states, controls, [[0], [1]])
