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
solution (Crandall & Lions 1984). One-sided derivatives are of third order with Koren's limiter
(1993), which also keeps kinks sharp; time steps are second-order TVD Runge-Kutta (Shu & Osher
1988). The order drops to one at kinks.

V is as low as K is deep wherever K takes a state, and where the flow squeezes states together the
bottom of that dip lies within a cell of the border; what blurs its kink moves the border, to the
unsafe side. Equation (9) holds for any increasing function of V as well, and is solved for one that
dips deeper, W = l (1 - exp(-V / l)) where V < 0, smoothly at the border. The length l is K's depth
where that is at most 2 cells, and grows with its number of cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.spaces import Bools, Floats
from mlci.system_check import check_affine
from mlci.systems import System

_COURANT = 0.8  # share of the largest stable step; below 1 because the scheme is not monotone
_LONGEST = 100.0  # [s] horizon at which the search for a fixed point gives up
_SHALLOW = 2.0  # cells up to which K counts as shallow: its dip is then e - 1 times as deep in W
_AT_ONCE = 1 << 14  # cells; more do not stay in the cache
_GHOSTS = 2  # cells that a derivative needs beyond each side


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
        gradients = []
        for d, width in enumerate(grid.widths):
            padded = _padded(values.reshape(grid.shape), d, grid.space.periodic[d])
            left, right = _one_sided(padded, d)
            gradients.append((left + right).ravel() / (2 * width))
        return cls(grid, values, np.stack(gradients, axis=-1))

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
    flows = _flows(system, grid)
    step = _COURANT / np.max(sum(np.max(np.abs(along.rates), axis=0) for along in flows))
    end = _LONGEST if horizon is None else horizon
    distances = constraints.signed_distance(grid.centers).reshape(grid.shape)
    depth = -distances.min()
    bend = depth * max(1.0, depth / (_SHALLOW * np.min(grid.widths)))
    values = np.where(distances < 0, -bend * np.expm1(-distances / bend), distances)
    elapsed = 0.0
    while elapsed < end:
        step = min(step, end - elapsed)
        once = values + step * _fall(values, flows, grid)
        after = 0.5 * (values + once + step * _fall(once, flows, grid))
        by_value = 1 - np.minimum(after, 0) / bend  # dW / dV
        change = np.max((values - after) / by_value, where=after <= depth, initial=0.0) / step
        values, elapsed = after, elapsed + step
        if horizon is None and change < tolerance:
            break
    else:
        if horizon is None:
            raise RuntimeError(
                f"V still falls by {change:.2g} per second after {_LONGEST:g} s, more than the "
                f"tolerance {tolerance:g}"
            )
    values = np.where(values < 0, -bend * np.log1p(-np.minimum(values, 0) / bend), values)
    return SafeSet.from_values(grid, values.ravel())


@dataclass(frozen=True, eq=False)
class _Flows:
    """The rates of one dimension under the extremal controls; controls may share one.

    Attributes:
        rates: (R, *shape) different rates at the cell centres, in cells per second.
        from_right: (R,) whether the flow comes from the right, so that V there matters for V here:
            each (*shape), or one truth value where it is the same everywhere.
        of_control: (vertices,) number of each extremal control's rate.
    """

    rates: Floats
    from_right: list[Bools | bool]
    of_control: list[int]


def _flows(system: System, grid: Grid) -> list[_Flows]:
    """h at the cell centres under every extremal control, by dimension."""
    vertices = system.control_box.vertices()
    velocities = [system.dynamics(grid.centers, vertex) / grid.widths for vertex in vertices]
    flows = []
    for d in range(len(grid.shape)):
        rates: list[Floats] = []
        of_control = []
        for velocity in velocities:
            rate = velocity[:, d].reshape(grid.shape)
            same = [number for number, other in enumerate(rates) if np.array_equal(rate, other)]
            of_control.append(same[0] if same else len(rates))
            if not same:
                rates.append(rate)
        right = [rate > 0 for rate in rates]
        sides = [bool(side.flat[0]) if np.all(side == side.flat[0]) else side for side in right]
        flows.append(_Flows(np.array(rates), sides, of_control))
    return flows


def _fall(values: Floats, flows: list[_Flows], grid: Grid) -> Floats:
    """min{0, max_u grad V . h} (*shape), upwind: the right side of (9)."""
    fall, periodic = np.empty(grid.shape), grid.space.periodic
    whole = _padded(values, 0, periodic[0])
    count = max(1, _AT_ONCE * grid.shape[0] // grid.size)
    for start in range(0, grid.shape[0], count):
        rows = slice(start, start + count)
        terms = []
        for d, along in enumerate(flows):
            within = slice(start, start + count + 2 * _GHOSTS)
            padded = _padded(values[rows], d, periodic[d]) if d else whole[within]
            left, right = _one_sided(padded, d)
            changes = [
                rate[rows] * _from_side(side, rows, right, left)
                for rate, side in zip(along.rates, along.from_right, strict=True)
            ]
            terms.append([changes[number] for number in along.of_control])
        sums = [reduce(np.add, parts) for parts in zip(*terms, strict=True)]
        fall[rows] = np.minimum(reduce(np.maximum, sums), 0.0)
    return fall


def _from_side(from_right: Bools | bool, rows: slice, right: Floats, left: Floats) -> Floats:
    """The derivative from the right where the flow comes from there, else that from the left."""
    if isinstance(from_right, bool):
        return right if from_right else left
    return np.where(from_right[rows], right, left)


def _padded(values: Floats, d: int, periodic: bool) -> Floats:
    """Values with the cells beyond both sides along d: round the circle, else the side's own."""
    first, last = _part(values, d, 0, _GHOSTS), _part(values, d, -_GHOSTS, None)
    if periodic:
        return np.concatenate([last, values, first], axis=d)
    first, last = _part(first, d, 0, 1), _part(last, d, -1, None)
    return np.concatenate([*[first] * _GHOSTS, values, *[last] * _GHOSTS], axis=d)


def _one_sided(padded: Floats, d: int) -> tuple[Floats, Floats]:
    """Left and right derivative (*shape) along d, times its cell width.

    The nearer difference is corrected by half of a second difference: by the mean of the central
    one and the one beyond, with weights 2/3 and 1/3, which is of third order; by no more than twice
    the smaller of them, and not at all where their signs differ (Koren 1993).
    """
    first = _part(padded, d, 1, None) - _part(padded, d, 0, -1)
    second = _part(first, d, 1, None) - _part(first, d, 0, -1)
    one, other = _part(second, d, 0, -1), _part(second, d, 1, None)
    most, least = np.minimum(one, other), np.maximum(one, other)
    np.maximum(most, 0.0, out=most)
    np.minimum(least, 0.0, out=least)
    second /= 6
    mean, central = one + other, _part(second, d, 1, -1)
    left, right = _part(mean, d, 0, -1) + central, _part(mean, d, 1, None) + central
    for bend, pair in ((left, (0, -1)), (right, (1, None))):
        np.minimum(bend, _part(most, d, *pair), out=bend)
        np.maximum(bend, _part(least, d, *pair), out=bend)
    left += _part(first, d, 1, -2)
    return left, np.subtract(_part(first, d, 2, -1), right, out=right)


def _part(array: Floats, d: int, start: int, stop: int | None) -> Floats:
    """array[start:stop] along d."""
    return array[(slice(None),) * d + (slice(start, stop),)]
