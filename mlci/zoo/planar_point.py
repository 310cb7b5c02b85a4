"""x' = u1, y' = u2: a point that moves in a plane as it is told."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System
from mlci.zoo.parts import batch_of, limited_space, require_positive, symmetric_box


@dataclass(frozen=True)
class PlanarPoint(System):
    """A point whose velocity is its control, so that it can stop anywhere and turn at once.

    The optimal path from a start to a goal is a straight line at constant speed, and every state
    outside of what is forbidden is safe.

    Attributes:
        position_limit: bound on abs(x) and abs(y) [m].
        speed_limit: bound on each component of the velocity [m/s].

    Raises:
        ValueError: a bound that is not positive and finite.
    """

    position_limit: float = 3.0
    speed_limit: float = 2.0

    def __post_init__(self) -> None:
        require_positive(self)

    @cached_property
    def space(self) -> StateSpace:
        return limited_space(("x", "y"), ("m", "m"), (self.position_limit,) * 2)

    @cached_property
    def control_box(self) -> Box:
        return symmetric_box(self.speed_limit, self.speed_limit)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        return np.broadcast_to(controls, (*batch_of(states, controls), 2))

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        batch = batch_of(states, controls)
        by_state = np.zeros((*batch, 2, 2))
        return by_state, np.broadcast_to(np.eye(2), (*batch, 2, 2))
