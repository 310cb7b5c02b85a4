"""A system that is another one but for what a subclass says."""

from __future__ import annotations

from dataclasses import dataclass

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System


@dataclass(frozen=True, eq=False)
class Wrapped(System):
    """Everything is asked of another system.

    Attributes:
        system: the other one.
    """

    system: System

    @property
    def space(self) -> StateSpace:
        return self.system.space

    @property
    def control_box(self) -> Box:
        return self.system.control_box

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        return self.system.dynamics(states, controls)

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        return self.system.jacobians(states, controls)

    def running_reward(self, states: Floats, controls: Floats) -> Floats:
        return self.system.running_reward(states, controls)

    def reward_derivatives(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        return self.system.reward_derivatives(states, controls)
