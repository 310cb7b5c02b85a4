"""A system with stronger or weaker controls."""

from __future__ import annotations

from dataclasses import dataclass

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System


@dataclass(frozen=True, eq=False)
class WithStrength(System):
    """A system that moves as another does, and whose control ranges are so many times as wide.

    Attributes:
        system: the other one.
        factor: by which the ends of its control ranges are multiplied.

    Raises:
        ValueError: a factor that is not positive.
    """

    system: System
    factor: float

    def __post_init__(self) -> None:
        if not self.factor > 0:
            raise ValueError(f"a strength must be positive, not {self.factor}")

    @property
    def space(self) -> StateSpace:
        return self.system.space

    @property
    def control_box(self) -> Box:
        box = self.system.control_box
        return Box(self.factor * box.lower, self.factor * box.upper)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        return self.system.dynamics(states, controls)

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        return self.system.jacobians(states, controls)

    def running_reward(self, states: Floats, controls: Floats) -> Floats:
        return self.system.running_reward(states, controls)

    def reward_derivatives(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        return self.system.reward_derivatives(states, controls)
