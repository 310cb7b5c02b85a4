"""x'' = u - k x - c x': a door with a strong closer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System
from mlci.zoo.parts import limited_space, matrix, rates, require_positive, symmetric_box


@dataclass(frozen=True, eq=False)
class DampedSpring(System):
    """A mass on a spring whose damper forgets speed within a fraction of a second, if c is large.

    Volumes of states shrink by e^(-c t).

    Attributes:
        position_limit: bound on |x| [m].
        speed_limit: bound on |x'| [m/s].
        control_limit: bound on |u| [m/s^2].
        stiffness: k [1/s^2].
        damping: c [1/s].
    """

    position_limit: float = 2.0
    speed_limit: float = 2.0
    control_limit: float = 6.0
    stiffness: float = 1.0
    damping: float = 4.0

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
        pull = self.stiffness * states[..., 0] + self.damping * states[..., 1]
        return rates(states, controls, [states[..., 1], controls[..., 0] - pull])

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        by_state = matrix(states, controls, [[0, 1], [-self.stiffness, -self.damping]])
        return by_state, matrix(states, controls, [[0], [1]])
