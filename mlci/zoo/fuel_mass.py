"""x'' = u, paid by fuel: large controls cost by their size rather than its square."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.spaces import Floats
from mlci.systems import DoubleIntegrator
from mlci.zoo.parts import matrix, rates, require_positive


@dataclass(frozen=True, eq=False)
class FuelMass(DoubleIntegrator):
    """A mass on a line whose reward is -2 d^2 (sqrt(1 + (u / d)^2) - 1), and no quadratic.

    For |u| far below the knee d it is -u^2, far above it is nearly -2 d |u|, as a thruster pays.

    Attributes:
        position_limit: bound on |x| [m].
        speed_limit: bound on |x'| [m/s].
        control_limit: bound on |u| [m/s^2].
        knee: d [m/s^2].
    """

    knee: float = 0.5

    def __post_init__(self) -> None:
        require_positive(self)

    def running_reward(self, states: Floats, controls: Floats) -> Floats:
        growth = np.sqrt(1 + np.square(controls[..., 0] / self.knee)) - 1
        return np.asarray(-2 * self.knee**2 * growth)

    def reward_derivatives(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        root = np.sqrt(1 + np.square(controls[..., 0] / self.knee))
        gradient = rates(states, controls, [0, 0, -2 * controls[..., 0] / root])
        return gradient, matrix(states, controls, [[0, 0, 0], [0, 0, 0], [0, 0, -2 / root**3]])
