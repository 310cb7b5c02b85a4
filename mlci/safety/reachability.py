"""The safe set: a Hamilton-Jacobi equation on a grid, section V-B.

V(x, tau) is the best that any control can do about the worst that happens within tau: the
largest, over controls, of the smallest signed distance to the keep-out set K on the way. Equation
(9), with time run forward from V(x, 0) = dist_K(x), is

    dV/dtau = min{0, max_u grad V . h(x, u)},

so that V only falls, and the states with V >= 0 are those that can stay out of K, (10).

The scheme of `upwind` is monotone at first order, which is what makes it converge to the viscosity
solution (Crandall & Lions 1984); its one-sided derivatives are of third order, and time steps are
second-order TVD Runge-Kutta (Shu & Osher 1988). The order drops to one at kinks.

V is as low as K is deep wherever K takes a state, and where the flow squeezes states together the
bottom of that dip lies within a cell of the border; what blurs its kink moves the border, to the
unsafe side. Equation (9) holds for any increasing function of V as well, and is solved for one that
dips deeper, W = l (1 - exp(-V / l)) where V < 0, smoothly at the border. The length l is K's depth
where that is at most 2 cells, and grows with its number of cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.upwind import euler_step, mean_derivatives, neighbour_rows
from mlci.spaces import Bools, Floats, Ints
from mlci.system_check import check_affine
from mlci.systems import System

_COURANT = 0.8  # share of the largest stable step; below 1 because the scheme is not monotone
_LONGEST = 100.0  # [s] horizon at which the search for a fixed point gives up
_SHALLOW = 2.0  # cells up to which K counts as shallow: its dip is then e - 1 times as deep in W


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
        rows = np.ascontiguousarray(values, dtype=float).reshape(-1, grid.shape[-1])
        means = np.empty((len(grid.shape), *rows.shape))
        mean_derivatives(rows, neighbour_rows(grid), bool(grid.space.periodic[-1]), means)
        return cls(grid, values, means.reshape(len(grid.shape), -1).T / grid.widths)

    def value(self, states: ArrayLike) -> Floats:
        """V (...,) at states (..., n)."""
        return self.grid.interpolate(self.values, states)

    def gradient(self, states: ArrayLike) -> Floats:
        """grad V (..., n) at states (..., n), interpolated from the cell centres."""
        return self.grid.interpolate(self.gradients, states)

    def slope(self, states: ArrayLike) -> Floats:
        """The derivative (..., n) of `value` itself, which jumps between the cell centres."""
        return self.grid.slope(self.values, states)

    @cached_property
    def steepness(self) -> float:
        """No two states differ in `value` by more than this times their Euclidean distance."""
        values, steepest = self.values.reshape(self.grid.shape), []
        for d, width in enumerate(self.grid.widths):
            seam = np.take(values, [0 if self.grid.space.periodic[d] else -1], axis=d)
            steepest.append(np.max(np.abs(np.diff(values, axis=d, append=seam))) / width)
        return float(np.linalg.norm(steepest))

    def contains(self, states: ArrayLike, margin: float = 0.0) -> Bools:
        """Whether V >= margin (...,) at states (..., n), equation (10)."""
        return np.asarray(self.value(states) >= margin)

    def safe_control(self, system: System, states: Floats) -> Floats:
        """u* (..., m) = argmax over the control box of grad V . h at states (..., n).

        The dynamics are affine in the control, so that each control's part is at the end of its
        range to which grad V . h rises.
        """
        lower, upper = system.control_box.lower, system.control_box.upper
        one_moved = np.where(np.eye(len(lower), dtype=bool), upper, lower)  # one control at a time
        base = system.dynamics(states, lower)
        rates = np.array([system.dynamics(states, corner) - base for corner in one_moved])
        rises = np.einsum("...i,j...i->...j", self.gradient(states), rates)
        return np.where(rises > 0, upper, lower)


class NotSettled(RuntimeError):
    """A safe set that `solve_safe_set` did not find, as V falls on and on."""


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
        NotSettled: no fixed point within 100 s of tau.
    """
    if horizon is not None and not horizon >= 0:
        raise ValueError(f"a horizon must be at least 0 s, not {horizon}")
    if not tolerance > 0:
        raise ValueError(f"a tolerance must be positive, not {tolerance}")
    for i in range(len(constraints)):
        deepest = np.min(constraints.shape(i).level(constraints.space, grid.centers))
        if not -np.inf < deepest < 0:
            raise ValueError(
                f"region {i} must hold at least one cell centre of a {list(grid.shape)} grid and "
                f"not the whole space; signed distances to it start at {deepest:g}"
            )
    check_affine(system)
    flows, beside = _flows(system, grid), neighbour_rows(grid)
    wraps = bool(grid.space.periodic[-1])
    step = _COURANT / flows.fastest
    end = _LONGEST if horizon is None else horizon
    distances = constraints.signed_distance(grid.centers).reshape(-1, grid.shape[-1])
    depth = -distances.min()
    bend = depth * max(1.0, depth / (_SHALLOW * np.min(grid.widths)))
    values = np.where(distances < 0, -bend * np.expm1(-distances / bend), distances)
    once, twice = np.empty_like(values), np.empty_like(values)
    elapsed = 0.0
    while elapsed < end:
        step = min(step, end - elapsed)
        for start, result in ((values, once), (once, twice)):
            euler_step(
                start, step, flows.rates, flows.along, flows.of_control, beside, wraps, result
            )
        after = 0.5 * (values + twice)
        counts = after <= depth
        by_value = 1 - np.minimum(after[counts], 0) / bend  # dW / dV
        change = np.max((values[counts] - after[counts]) / by_value, initial=0.0) / step
        values, elapsed = after, elapsed + step
        if horizon is None and change < tolerance:
            break
    else:
        if horizon is None:
            raise NotSettled(
                f"V still falls by {change:.2g} per second after {_LONGEST:g} s, more than the "
                f"tolerance {tolerance:g}"
            )
    values = np.where(values < 0, -bend * np.log1p(-np.minimum(values, 0) / bend), values)
    return SafeSet.from_values(grid, values.ravel())


@dataclass(frozen=True, eq=False)
class _Flows:
    """The rates under the extremal controls; controls share those that they do not move.

    Attributes:
        rates: (R, rows, m) different rates at the cell centres, in cells per second; m cells in a
            row along the last dimension.
        along: (R,) the dimension that each is a rate of.
        of_control: (vertices, n) number of the rate of each dimension under each extremal control.
    """

    rates: Floats
    along: Ints
    of_control: Ints

    @property
    def fastest(self) -> float:
        """The largest sum over dimensions of the largest rate, in cells per second."""
        dimensions = range(self.of_control.shape[1])
        most = [np.max(np.abs(self.rates[self.along == d]), axis=0) for d in dimensions]
        return float(np.max(sum(most)))


def _flows(system: System, grid: Grid) -> _Flows:
    """h at the cell centres under every extremal control."""
    vertices = system.control_box.vertices()
    velocities = [system.dynamics(grid.centers, vertex) / grid.widths for vertex in vertices]
    rates: list[Floats] = []
    along: list[int] = []
    of_control = np.empty((len(vertices), len(grid.shape)), dtype=np.int64)
    for d in range(len(grid.shape)):
        for vertex, velocity in enumerate(velocities):
            rate = velocity[:, d].reshape(-1, grid.shape[-1])
            same = [k for k, of in enumerate(along) if of == d and np.array_equal(rates[k], rate)]
            of_control[vertex, d] = same[0] if same else len(rates)
            if not same:
                rates.append(rate)
                along.append(d)
    return _Flows(np.array(rates), np.array(along, dtype=np.int64), of_control)
