"""The safe set without an equation: what the best constant extremal control achieves.

V(x) is at least the largest, over the corners u of the control box, of the smallest signed distance
to K along the motion that holds u:

    v(x) = max_u min_{0 <= t <= horizon} dist_K(x_u(t)).

Where v >= 0 a control that avoids K for the horizon is known, and holding it keeps v from falling.
A grid only tabulates v: it adds an error of interpolation, but no numerical diffusion, which on the
coarse grids that four dimensions allow moves the border of the equation's solution (9) by more than
a cell, and to the unsafe side.

Motions stop at the bounds of the state space and slide along them: a rate that points out of the
bounds counts as 0.

A motion is known at samples, and comes closest to K between two of them. What is computed is a
lower bound of v, by `closest_approach`. Not covered is the error of the integrator itself, of
fourth order in the step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.closest_approach import KeepOut
from mlci.safety.reachability import SafeSet
from mlci.simulate import rk4_step, step_count
from mlci.spaces import Bools, Box, Floats, Ints, StateSpace
from mlci.system_check import check_affine
from mlci.systems import System

_AT_ONCE = 1 << 14  # states; more do not stay in the cache
_STEPS_BETWEEN = 8  # steps after which motions that cannot matter any more are dropped
_LOOK_AHEAD = 0.05  # of the horizon, after which controls are compared; no step is longer
_LOSS = 0.1  # of the smallest cell that the bow of a motion in one step may be
_ENOUGH = 2.0  # times the depth of K up to which v is told
_INSTANT = 1e-4  # [s] over which the change of a rate is measured


@dataclass(frozen=True, eq=False)
class _Sliding(System):
    """A system whose motions stop at the bounds of the state space and slide along them."""

    system: System

    @property
    def space(self) -> StateSpace:
        return self.system.space

    @property
    def control_box(self) -> Box:
        return self.system.control_box

    @cached_property
    def _limits(self) -> tuple[Floats, Floats]:
        """(n,) lower and upper bounds, infinite where the space is periodic."""
        bounds, periodic = self.space.bounds, self.space.periodic
        return np.where(periodic, -np.inf, bounds.lower), np.where(periodic, np.inf, bounds.upper)

    def clip(self, states: Floats) -> Floats:
        """states (..., n), brought to the nearest bound where they are beyond it."""
        lower, upper = self._limits
        return np.minimum(np.maximum(states, lower), upper)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        """h at the nearest states within the bounds; the rates across a bound are not stopped."""
        return self.system.dynamics(self.clip(states), controls)

    def stopped(self, rates: Floats, states: Floats) -> Floats:
        """Rates at states within the bounds, 0 where they point across a bound."""
        lower, upper = self._limits
        inward = ((rates < 0) | (states < upper)) & ((rates > 0) | (states > lower))
        return rates * inward


def tabulate_escapes(
    system: System, grid: Grid, constraints: Regions, *, horizon: float
) -> SafeSet:
    """Tabulate the lower bound of v at the cell centres of a grid; see the module's head.

    The step between samples is so short that the bound loses about a tenth of a cell.

    v is told up to twice the depth of K (or a cell's width, if that is more): a larger one is put
    down as that. It is computed where K is so near, and from there on outwards, until it is known
    at all neighbours of each smaller one. Who comes to K from farther away first passes a cell with
    no smaller one at its corners, from where a constant control keeps out of K.

    Args:
        system: the dynamics and the control box.
        grid: where v is computed.
        constraints: K.
        horizon: for how long the motions last [s].

    Raises:
        ValueError: dynamics that are not affine in the control, where u* is no corner of its box.
    """
    check_affine(system)
    step = _step_for(system, grid, constraints, horizon)
    keep_out, distances = KeepOut.of(constraints), constraints.signed_distance(grid.centers)
    widest = np.max(grid.widths[keep_out.counted], initial=0.0)
    enough = _ENOUGH * max(keep_out.depth, widest)
    values, known, low = np.full(grid.size, enough), np.zeros(grid.size, bool), distances < enough
    while len(new := np.flatnonzero(_with_neighbours(low, grid) & ~known)):
        v = escape_value(system, constraints, grid.centers[new], horizon, step, enough)
        values[new], known[new], low[new] = np.minimum(v, enough), True, v < enough
    return SafeSet.from_values(grid, values)


def _with_neighbours(cells: Bools, grid: Grid) -> Bools:
    """Some cells (S,) and all that touch one of them, by a corner at least."""
    wide = cells.reshape(grid.shape)
    for d, count in enumerate(grid.shape):
        before, after = (np.take(wide, np.arange(count) + k, axis=d, mode="wrap") for k in (-1, 1))
        if not grid.space.periodic[d]:
            np.moveaxis(before, d, 0)[0] = False
            np.moveaxis(after, d, 0)[-1] = False
        wide = wide | before | after
    return wide.ravel()


def escape_value(
    system: System,
    constraints: Regions,
    states: Floats,
    horizon: float,
    step: float,
    enough: float = np.inf,
) -> Floats:
    """A lower bound (B,) of v at states (B, n), in the unit of dist_K.

    Args:
        system: the dynamics and the control box.
        constraints: K.
        states: (B, n) where the motions begin.
        horizon: for how long they last [s].
        step: time between the samples of the motions [s]; divides the horizon.
        enough: once one control achieves it, the others are not tried.
    """
    steps, keep_out = step_count(horizon, step), KeepOut.of(constraints)
    sliding, parts = _Sliding(system), [np.empty(0)]
    for first in range(0, len(states), _AT_ONCE):
        part = np.asfortranarray(states[first : first + _AT_ONCE], dtype=float)
        order = _promising(sliding, constraints, part, horizon * _LOOK_AHEAD)
        distances, best = constraints.signed_distance(part), np.full(len(part), -np.inf)
        for controls in system.control_box.vertices()[order]:
            hopeful = np.flatnonzero(best < np.minimum(distances, enough))
            motions = part[hopeful], controls[hopeful], distances[hopeful], best[hopeful]
            best[hopeful] = _held(sliding, keep_out, *motions, steps, step)
        parts.append(best)
    return np.concatenate(parts)


def _step_for(system: System, grid: Grid, constraints: Regions, horizon: float) -> float:
    """The step [s] at which the bow of a motion in a step is at most `_LOSS` of a cell."""
    counted = KeepOut.of(constraints).counted
    fastest = 0.0
    for first in range(0, grid.size, _AT_ONCE):
        states = grid.centers[first : first + _AT_ONCE]
        for control in system.control_box.vertices():
            rates = system.dynamics(states, control)
            then = system.dynamics(states + _INSTANT * rates, control)
            change = np.sum(((then - rates)[:, counted] / _INSTANT) ** 2, axis=1)
            fastest = max(fastest, float(np.sqrt(np.max(change))))
    loss = _LOSS * np.min(grid.widths[counted], initial=np.inf)
    steps = max(np.sqrt(fastest / (4 * loss)) * horizon, 1 / _LOOK_AHEAD)
    return float(horizon / np.ceil(steps))


def _promising(system: _Sliding, constraints: Regions, states: Floats, ahead: float) -> Ints:
    """(vertices, B) the controls' numbers, those first that are farther from K a while ahead.

    Where the best control comes first, the motions of the others can be left sooner.
    """
    distances = [
        constraints.signed_distance(system.clip(rk4_step(system, states, control, ahead)))
        for control in system.control_box.vertices()
    ]
    return np.argsort(-np.array(distances), axis=0, kind="stable")


def _held(
    system: _Sliding,
    keep_out: KeepOut,
    states: Floats,
    controls: Floats,
    distances: Floats,
    best: Floats,
    steps: int,
    step: float,
) -> Floats:
    """What holding controls (B, m) from states (B, n) achieves (B,), if that is more than best.

    The states are at distances (B,) from K.

    A motion counts as long as it is better than the best.
    """
    best, row = best.copy(), np.arange(len(states))
    now, control = np.asfortranarray(states), np.asfortranarray(controls)
    distance, least = distances.copy(), distances.copy()
    drift = np.asfortranarray(system.dynamics(now, control))
    rates = system.stopped(drift, now)
    for k in range(steps):
        then = np.asfortranarray(system.clip(rk4_step(system, now, control, step, drift)))
        drift = np.asfortranarray(system.dynamics(then, control))
        rates_then = system.stopped(drift, then)
        keep_out.approach((now, then), (rates, rates_then), step, distance, least)
        now, rates = then, rates_then
        if k % _STEPS_BETWEEN == 0:
            moves, counts = np.any(rates != 0, axis=1), least > best[row]
            best[row[counts & ~moves]] = least[counts & ~moves]
            go = counts & moves
            row, least, distance = row[go], least[go], distance[go]
            now, control, rates, drift = (
                np.asfortranarray(each[go]) for each in (now, control, rates, drift)
            )
    best[row] = np.maximum(best[row], least)
    return best
