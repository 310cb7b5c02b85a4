"""The safe set: a Hamilton-Jacobi equation on a grid, section V-B.

V(x, tau) is the best that any control can do about the worst that happens within tau: the
largest, over controls, of the smallest signed distance to the keep-out set K on the way. Equation
(9), with time run forward from V(x, 0) = dist_K(x), is

    dV/dtau = min{0, max_u grad V . h(x, u)},

so that V only falls, and the states with V >= 0 are those that can stay out of K, (10).

The scheme is an upwind one on cell centres. For each extremal control, each dimension's derivative
is taken from the side that the flow comes to, and the largest sum over the controls is clipped at
zero. For dynamics that are affine in the control the maximum over the box is one over its vertices,
and the scheme is monotone at first order, which is what makes it converge to the viscosity
solution (Crandall & Lions 1984). One-sided derivatives are the second-order ENO ones and time steps
second-order TVD Runge-Kutta (Osher & Shu 1991; Shu & Osher 1988). The order drops to one at kinks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.spaces import Bools, Floats
from mlci.system_check import check_affine
from mlci.systems import System

_COURANT = 0.8  # share of the largest stable step; below 1 because ENO is not monotone
_LONGEST = 100.0  # [s] horizon at which the search for a fixed point gives up
_GHOSTS = 2  # cells that the ENO stencil needs beyond each side


@dataclass(frozen=True, eq=False)
class SafeSet:
    """Omega of (10): where a value function on a grid is not negative.

    Attributes:
        grid: the grid.
        values: (S,) V at the cell centres, in the unit of dist_K.
        gradients: (S, n) grad V at the cell centres.

    Raises:
        ValueError: arrays that do not fit the grid or are not finite.
    """

    grid: Grid
    values: Floats
    gradients: Floats

    def __post_init__(self) -> None:
        size, n = self.grid.size, len(self.grid.shape)
        if self.values.shape != (size,) or self.gradients.shape != (size, n):
            raise ValueError(
                f"a grid of {size} cells needs values ({size},) and gradients ({size}, {n}), "
                f"not {self.values.shape} and {self.gradients.shape}"
            )
        if not (np.all(np.isfinite(self.values)) and np.all(np.isfinite(self.gradients))):
            raise ValueError("the values and gradients of a safe set must be finite")

    @classmethod
    def from_values(cls, grid: Grid, values: Floats) -> SafeSet:
        """The safe set of values (S,), with the means of their one-sided derivatives."""
        one_sided = [
            _one_sided(values.reshape(grid.shape), d, grid) for d in range(len(grid.shape))
        ]
        gradients = np.stack([(left + right).ravel() / 2 for left, right in one_sided], axis=-1)
        return cls(grid, values, gradients)

    def value(self, states: ArrayLike) -> Floats:
        """V (...,) at states (..., n)."""
        return self.grid.interpolate(self.values, states)

    def gradient(self, states: ArrayLike) -> Floats:
        """grad V (..., n) at states (..., n), interpolated from the cell centres."""
        return self.grid.interpolate(self.gradients, states)

    def slope(self, states: ArrayLike) -> Floats:
        """The derivative (..., n) of `value` itself, which jumps between the cell centres."""
        return self.grid.slope(self.values, states)

    def contains(self, states: ArrayLike, margin: float = 0.0) -> Bools:
        """Whether V >= margin (...,) at states (..., n), equation (10)."""
        return np.asarray(self.value(states) >= margin)

    def safe_control(self, system: System, states: Floats) -> Floats:
        """u* (..., m) = argmax over the control box of grad V . h at states (..., n)."""
        vertices, gradient = system.control_box.vertices(), self.gradient(states)
        rates = [np.sum(gradient * system.dynamics(states, vertex), axis=-1) for vertex in vertices]
        return vertices[np.argmax(rates, axis=0)]


def solve_safe_set(
    system: System,
    grid: Grid,
    constraints: Regions,
    *,
    horizon: float | None = None,
    tolerance: float = 1e-3,
) -> SafeSet:
    """Solve (9) for the states that can stay out of a keep-out set.

    Args:
        system: dynamics, affine in the control.
        grid: where V is computed. Beyond a side that is not periodic V is continued by its
            value at the side, which treats a flow across it as one that slides along it: nothing
            enters that the grid does not hold, and the scheme stays monotone.
        constraints: K.
        horizon: tau at which to stop [s]; None runs until V stands still.
        tolerance: fastest fall of V at which it stands still, unit of dist_K per second. It is
            asked of |V| up to the depth of K: the level sets of V move independently of one
            another, and those far from the border may creep for long where a flow stagnates.

    Returns:
        The safe set; control-invariant only without a horizon.

    Raises:
        ValueError: a horizon below 0, a tolerance that is not positive, a region that is
            everything or so small that the grid misses it, or dynamics that are not affine in the
            control.
        RuntimeError: no fixed point within 100 s of tau.
    """
    if horizon is not None and not horizon >= 0:
        raise ValueError(f"a horizon must be at least 0 s, not {horizon}")
    if not tolerance > 0:
        raise ValueError(f"a tolerance must be positive, not {tolerance}")
    for i in range(len(constraints)):
        deepest = np.min(constraints.space.signed_distance(grid.centers, constraints.box(i)))
        if not -np.inf < deepest < 0:
            raise ValueError(
                f"region {i} must hold at least one cell centre of a {list(grid.shape)} grid and "
                f"not the whole space; signed distances to it start at {deepest:g}"
            )
    check_affine(system)
    rates = _extremal_rates(system, grid)
    fastest = np.max(np.sum(np.max(np.abs(rates), axis=0).T / grid.widths, axis=-1))
    step = _COURANT / fastest
    end = _LONGEST if horizon is None else horizon
    values = constraints.signed_distance(grid.centers).reshape(grid.shape)
    depth = -values.min()
    elapsed = 0.0
    while elapsed < end:
        step = min(step, end - elapsed)
        once = values + step * _fall(values, rates, grid)
        after = 0.5 * (values + once + step * _fall(once, rates, grid))
        near = np.abs(after) <= depth
        change = np.max((values - after)[near], initial=0.0) / step
        values, elapsed = after, elapsed + step
        if horizon is None and change < tolerance:
            break
    else:
        if horizon is None:
            raise RuntimeError(
                f"V still falls by {change:.2g} per second after {_LONGEST:g} s, more than the "
                f"tolerance {tolerance:g}"
            )
    return SafeSet.from_values(grid, values.ravel())


def _extremal_rates(system: System, grid: Grid) -> Floats:
    """h (vertices, n, *shape) at the cell centres under every extremal control."""
    vertices = system.control_box.vertices()
    rates = [system.dynamics(grid.centers, vertex) for vertex in vertices]
    return np.stack([rate.T.reshape(-1, *grid.shape) for rate in rates])


def _fall(values: Floats, rates: Floats, grid: Grid) -> Floats:
    """min{0, max_u grad V . h} (*shape), upwind: the right side of (9)."""
    sums = [np.zeros(grid.shape) for _ in rates]
    for d in range(values.ndim):
        left, right = _one_sided(values, d, grid)
        for total, rate in zip(sums, rates[:, d], strict=True):
            total += rate * np.where(rate > 0, right, left)
    return np.minimum(np.max(sums, axis=0), 0.0)


def _one_sided(values: Floats, d: int, grid: Grid) -> tuple[Floats, Floats]:
    """Left and right derivative (*shape) along dimension d: ENO of second order."""
    count = values.shape[d]
    reach = np.arange(-_GHOSTS, count + _GHOSTS)
    nodes = reach % count if grid.space.periodic[d] else np.clip(reach, 0, count - 1)
    first = np.diff(values.take(nodes, axis=d), axis=d) / grid.widths[d]
    second = np.diff(first, axis=d)

    def part(array: Floats, start: int, stop: int | None) -> Floats:
        """array[start:stop] along d."""
        return array[(slice(None),) * d + (slice(start, stop),)]

    one, other = part(second, 0, -1), part(second, 1, None)
    bend = 0.5 * np.where(np.abs(one) < np.abs(other), one, other)
    slopes = part(first, 1, -1)
    rightwards, leftwards = slopes + bend, slopes - bend
    return part(rightwards, 0, -1), part(leftwards, 1, None)
