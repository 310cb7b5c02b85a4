"""The least restrictive safety filter: a control is free until it would leave the safe set."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.control.control_problem import ControlFilter
from mlci.safety.reachability import SafeSet
from mlci.simulate import EULER, Integrator
from mlci.spaces import Floats
from mlci.systems import System

_FLAT = 1e-9  # steepness below which V counts as constant


@dataclass(frozen=True, eq=False)
class SafetyFilter(ControlFilter):
    """Replaces a control by u* when the state after one more hold would not be safe.

    With z = (V(x') - margin) / width, where x' is the state one step later, the applied control is

        lambda(z) u + (1 - lambda(z)) u*(x),    lambda = 0 for z <= 0, z^2 (3 - 2z), 1 for z >= 1.

    A width of 0 is the hard switch. Nominal controls are not clipped to the control box.

    Attributes:
        system: the system.
        safe_set: its safe set.
        dt: hold time of the controls [s].
        margin: smallest V that a free control may lead to, in the unit of V.
        width: range of V above the margin over which the relaxed filter blends.
        integrator: how states move on, the same as the demonstrator's.

    Raises:
        ValueError: dt not positive, or a margin or width below 0.
    """

    system: System
    safe_set: SafeSet
    dt: float
    margin: float
    width: float = 0.0
    integrator: Integrator = EULER

    def __post_init__(self) -> None:
        if not self.dt > 0:
            raise ValueError(f"a filter's hold must be positive, not {self.dt} s")
        if not (self.margin >= 0 and self.width >= 0):
            raise ValueError(
                f"a filter's margin and width must be at least 0, not {self.margin} and "
                f"{self.width}"
            )

    def apply(self, states: Floats, controls: Floats, ahead: Floats | None = None) -> Floats:
        """Controls (..., m) that are applied at states (..., n) for nominal controls (..., m).

        To what states (..., n) those lead in a hold may be known: `ahead`.
        """
        if ahead is None:
            ahead = self.integrator.step(self.system, states, controls, self.dt)
        share, _ = self._share(ahead)
        near = share < 1
        applied = np.array(controls, dtype=float)
        if near.any():
            safe = self.safe_set.safe_control(self.system, states[near])
            applied[near] = safe + share[near][:, None] * (applied[near] - safe)
        return applied

    def clearance(self, states: Floats) -> Floats:
        """How far (...) states (..., n) may move, Euclidean, before it could change a control."""
        room = self.safe_set.value(states) - (self.margin + self.width)
        return room / max(self.safe_set.steepness, _FLAT)

    def linearize(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        """Derivatives of the applied control.

        u* counts as locally constant, as it is except where it switches.

        Args:
            states: (..., n).
            controls: (..., m) nominal controls.

        Returns:
            By the state (..., m, n), and by the nominal control (..., m, m).
        """
        ahead = self.integrator.step(self.system, states, controls, self.dt)
        share, slope = self._share(ahead)
        batch, n, m = states.shape[:-1], states.shape[-1], controls.shape[-1]
        by_state = np.zeros((*batch, m, n))
        by_control = share[..., None, None] * np.eye(m)
        blend = slope > 0
        if blend.any():
            x, u = states[blend], controls[blend]
            gradient = slope[blend][:, None] * self.safe_set.slope(ahead[blend])
            drift, push = self.integrator.rate_jacobians(self.system, x, u, self.dt)
            by_x = gradient + self.dt * np.einsum("bi,bij->bj", gradient, drift)
            by_u = self.dt * np.einsum("bi,bij->bj", gradient, push)
            override = u - self.safe_set.safe_control(self.system, x)
            by_state[blend] += override[:, :, None] * by_x[:, None, :]
            by_control[blend] += override[:, :, None] * by_u[:, None, :]
        return by_state, by_control

    def _share(self, ahead: Floats) -> tuple[Floats, Floats]:
        """lambda (...,), and its derivative by V (...,), at states (..., n) after the hold."""
        room = self.safe_set.value(ahead) - self.margin
        if self.width == 0:
            return np.where(room >= 0, 1.0, 0.0), np.zeros(room.shape)
        z = np.clip(room / self.width, 0.0, 1.0)
        return z * z * (3 - 2 * z), 6 * z * (1 - z) / self.width


def border_margin(system: System, safe_set: SafeSet, dt: float) -> float:
    """A margin for `SafetyFilter`: the most that V changes over a cell and a hold at the border.

    The grid knows the border to about a cell, and a hold moves the state on before the next
    decision. Over both, V changes by at most sum_d |dV/dx_d| (width_d + max_u |h_d| dt); the margin
    is the largest such change among the cells on the border, those with a neighbour across it. It
    shrinks with the cells and with dt, and grows where V is steep, for there a small error in the
    state is a large one in V.

    Args:
        system: the system.
        safe_set: its safe set.
        dt: hold time [s].

    Returns:
        The margin, in the unit of V; 0 if the border does not cross the grid.

    Raises:
        ValueError: the margin exceeds V everywhere. V jumps where a weak control decides at once
            between escape and capture, and then no level of V says how far the border is.
    """
    grid = safe_set.grid
    doomed = safe_set.values.reshape(grid.shape) < 0
    at_border = np.zeros(grid.shape, dtype=bool)
    for d in range(len(grid.shape)):
        across = doomed != np.roll(doomed, -1, axis=d)
        if not grid.space.periodic[d]:
            np.moveaxis(across, d, 0)[-1] = False
        at_border |= across | np.roll(across, 1, axis=d)
    chosen = at_border.ravel()
    rates = [
        np.abs(system.dynamics(grid.centers[chosen], vertex))
        for vertex in system.control_box.vertices()
    ]
    reach = grid.widths + dt * np.max(rates, axis=0)
    change = np.sum(np.abs(safe_set.gradients[chosen]) * reach, axis=-1)
    margin = float(np.max(change, initial=0.0))
    if margin > np.max(safe_set.values):
        raise ValueError(
            f"V changes by up to {margin:.3g} over a cell and a hold at the border, more than its "
            f"largest value {np.max(safe_set.values):.3g}: choose a margin by hand"
        )
    return margin
