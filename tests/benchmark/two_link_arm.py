"""A two-link arm on a table whose motors build up torque: a system of six dimensions."""

from dataclasses import dataclass

import numpy as np

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System


@dataclass(frozen=True)
class TwoLinkArm(System):
    """M(q) q'' + C(q, q') = torque, torque' = u; shoulder and elbow, with no gravity in the plane.

    Attributes:
        base, coupled, outer: inertia round the shoulder, between the links, and of the forearm
            round the elbow [kg m^2].
        speed_limit: of both joints [rad/s].
        torque_limit: of both motors [N m].
        rate_limit: how fast a torque changes [N m / s].
    """

    base: float = 3.0
    coupled: float = 0.3
    outer: float = 2.0
    speed_limit: float = 1.2
    torque_limit: float = 1.0
    rate_limit: float = 4.0

    @property
    def space(self) -> StateSpace:
        most = np.repeat([self.speed_limit, self.torque_limit], 2)
        bounds = Box(np.append([-1.0, 0.0], -most), np.append([2.0, 2.5], most))
        names = ("shoulder", "elbow", "shoulder_speed", "elbow_speed", "torque_1", "torque_2")
        units = ("rad", "rad", "rad/s", "rad/s", "N m", "N m")
        return StateSpace(bounds, np.zeros(6, bool), names, units)

    @property
    def control_box(self) -> Box:
        return Box(np.full(2, -self.rate_limit), np.full(2, self.rate_limit))

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        rates = np.empty((6, *np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])))
        _, elbow, w1, w2, torque_1, torque_2 = np.moveaxis(states, -1, 0)
        bend, swirl = self.coupled * np.cos(elbow), self.coupled * np.sin(elbow)
        both, across = self.base + 2 * bend, self.outer + bend
        push_1 = torque_1 + swirl * w2 * (2 * w1 + w2)
        push_2 = torque_2 - swirl * np.square(w1)
        scale = 1 / (both * self.outer - np.square(across))
        rates[0], rates[1] = w1, w2
        rates[2] = scale * (self.outer * push_1 - across * push_2)
        rates[3] = scale * (both * push_2 - across * push_1)
        rates[4], rates[5] = controls[..., 0], controls[..., 1]
        return np.moveaxis(rates, 0, -1)
