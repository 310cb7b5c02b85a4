"""The random motion of one task without cells: what (2) means over continuous controls.

With the reward r and controls u_k that are held for dt, the paths from a start into a goal have the
density

    f(u) = exp(sum_k r(x_k, u_k) dt / temperature) [x_T in the goal, x in the state space] / Z

by the controls (T, m), and Z is its integral. For r = -|u|^2 the controls are independent Gaussians
of variance temperature / (2 dt), conditioned on the goal: as dt falls, white noise of the same
power. A tabular model whose actions are da apart approaches log Z - T log da.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.control.control_problem import control_limits
from mlci.simulate import RK4, Integrator, in_substeps
from mlci.spaces import Bools, Box, Floats, middle_and_half
from mlci.systems import System


@dataclass(frozen=True, eq=False)
class Passage:
    """Paths from a start into a goal region, and their density.

    Attributes:
        system: dynamics, state space and running reward.
        start: (n,) first state.
        goal: region of the last state; infinite sides where it is free.
        steps: T, the number of controls.
        dt: for which a control is held [s].
        temperature: divides the reward.
        substeps: Runge-Kutta steps a hold, the chords of which stand for the path.
        limit: range of the controls; None for no limit.

    Raises:
        ValueError: a start outside the state space, a goal without width in some dimension, or
            steps, dt, temperature or substeps that are not positive.
    """

    system: System
    start: Floats
    goal: Box
    steps: int
    dt: float
    temperature: float = 1.0
    substeps: int = 1
    limit: Box | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "dt", "temperature", "substeps"):
            if not getattr(self, name) > 0:
                raise ValueError(f"a passage's {name} must be positive, not {getattr(self, name)}")
        if not self.system.space.contains(self.start):
            raise ValueError(f"the start {self.start} lies outside the state space")
        if not np.all(self.goal.widths > 0):
            raise ValueError(f"a goal that is sampled needs width in each dimension: {self.goal}")

    @cached_property
    def integrator(self) -> Integrator:
        """How a state moves on in a hold."""
        return in_substeps(RK4, self.substeps)

    @cached_property
    def half(self) -> Floats:
        """(n,) half widths of the goal; infinite where it is free."""
        _, half = middle_and_half(self.goal)
        space = self.system.space
        return np.where(space.periodic & (2 * half >= space.bounds.widths), np.inf, half)

    @cached_property
    def nearest_goal(self) -> Floats:
        """(n,) middle of the goal, by the winding that is nearest to the start."""
        middle, _ = middle_and_half(self.goal)
        return self.start + self.system.space.difference(middle, self.start)

    @property
    def limits(self) -> tuple[Floats, Floats]:
        """(m,) least and largest controls."""
        return control_limits(self.system, self.limit)

    def goal_price(self, share: float) -> Floats:
        """(n,) price of the squared distance from the goal's middle, for a Gaussian in its place.

        Its standard deviation is a share of the half width; 0 where the goal is free.
        """
        return self.temperature / (2 * np.square(share * self.half))

    def log_reward(self, states: Floats, controls: Floats) -> Floats:
        """sum r dt / temperature (N,) of states (N, T, n), where controls (N, T, m) begin."""
        reward = self.system.running_reward(states, controls)
        total = np.sum(np.broadcast_to(reward, controls.shape[:-1]), axis=-1)
        return np.asarray(total * self.dt / self.temperature)

    def excess(self, last: Floats) -> Floats:
        """(N,) how far last states (N, n) are from the goal's middle, in half widths: the largest
        over the dimensions; at most 1 in the goal."""
        offset = self.system.space.difference(last, self.nearest_goal)
        return np.asarray(np.max(np.abs(offset) / self.half, axis=-1))

    def stays(self, paths: Floats) -> Bools:
        """(N,) which paths (N, K+1, n) stay in the state space."""
        return np.asarray(np.all(self.system.space.contains(paths), axis=-1))
