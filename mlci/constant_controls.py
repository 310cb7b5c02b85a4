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
lower bound of v: between samples the motion stays within step / 4 times the change of its rate of
the chord (twice what a steady acceleration needs), and along a chord the signed distance to a box
is convex, so that its tangents bound it from below. Not covered is the error of the integrator
itself, of fourth order in the step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.grids import Grid
from mlci.reachability import SafeSet
from mlci.regions import Regions
from mlci.simulate import rk4_step, step_count
from mlci.spaces import Bools, Box, Floats, Ints, StateSpace, middle_and_half
from mlci.system_check import check_affine
from mlci.systems import System

_AT_ONCE = 1 << 14  # states; more do not stay in the cache
_STEPS_BETWEEN = 8  # steps after which motions that cannot matter any more are dropped
_LOOK_AHEAD = 0.05  # of the horizon, after which controls are compared; no step is longer
_LOSS = 0.1  # of the smallest cell that the bow of a motion in one step may be
_INSTANT = 1e-4  # [s] over which the change of a rate is measured
_CUTS = 4  # tangents that close in on the least distance along a chord


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

    def rates(self, states: Floats, controls: Floats) -> Floats:
        """h at states within the bounds, 0 where it points across a bound."""
        lower, upper = self._limits
        rates = self.system.dynamics(states, controls)
        inward = ((rates < 0) | (states < upper)) & ((rates > 0) | (states > lower))
        return rates * inward


def tabulate_escapes(
    system: System, grid: Grid, constraints: Regions, *, horizon: float
) -> SafeSet:
    """Tabulate the lower bound of v at the cell centres of a grid; see the module's head.

    The step between samples is so short that the bound loses about a tenth of a cell.

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
    return SafeSet.from_values(grid, escape_value(system, constraints, grid.centers, horizon, step))


def escape_value(
    system: System, constraints: Regions, states: Floats, horizon: float, step: float
) -> Floats:
    """A lower bound (B,) of v at states (B, n), in the unit of dist_K.

    Args:
        system: the dynamics and the control box.
        constraints: K.
        states: (B, n) where the motions begin.
        horizon: for how long they last [s].
        step: time between the samples of the motions [s]; divides the horizon.
    """
    steps = step_count(horizon, step)
    sliding, parts = _Sliding(system), [np.empty(0)]
    for first in range(0, len(states), _AT_ONCE):
        part = np.asfortranarray(states[first : first + _AT_ONCE])
        order = _promising(sliding, constraints, part, horizon * _LOOK_AHEAD)
        best = np.full(len(part), -np.inf)
        for controls in system.control_box.vertices()[order]:
            _improve(best, sliding, constraints, part, controls, steps, step)
        parts.append(best)
    return np.concatenate(parts)


def _step_for(system: System, grid: Grid, constraints: Regions, horizon: float) -> float:
    """The step [s] at which the bow of a motion in a step is at most `_LOSS` of a cell."""
    counts = _counted(constraints)
    fastest = 0.0
    for first in range(0, grid.size, _AT_ONCE):
        states = grid.centers[first : first + _AT_ONCE]
        for control in system.control_box.vertices():
            rates = system.dynamics(states, control)
            then = system.dynamics(states + _INSTANT * rates, control)
            change = _length((then - rates)[:, counts]) / _INSTANT
            fastest = max(fastest, float(np.max(change)))
    loss = _LOSS * np.min(grid.widths[counts], initial=np.inf)
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


def _improve(
    best: Floats,
    system: _Sliding,
    constraints: Regions,
    states: Floats,
    controls: Floats,
    steps: int,
    step: float,
) -> None:
    """Raise best (B,) to what holding controls (B, m) from states (B, n) achieves, if that is more.

    A motion counts as long as it is better than the best.
    """
    counts = _counted(constraints)
    distance = constraints.signed_distance(states)
    row = np.flatnonzero(best < distance)
    now, control = np.asfortranarray(states[row]), np.asfortranarray(controls[row])
    distance, least = distance[row], distance[row]
    rates = system.rates(now, control)
    for k in range(steps):
        then = system.clip(rk4_step(system, now, control, step))
        distance_then, rates_then = constraints.signed_distance(then), system.rates(then, control)
        bow = step / 4 * _length((rates_then - rates)[:, counts])
        chord = _length((then - now)[:, counts])
        near = np.flatnonzero((distance + distance_then - chord) / 2 - bow < least)
        on_chord = _least_on_chords(constraints, now[near], then[near]) - bow[near]
        least[near] = np.minimum(least[near], on_chord)
        now, distance, rates = then, distance_then, rates_then
        if k % _STEPS_BETWEEN == 0:
            moves, counted = np.any(rates != 0, axis=1), least > best[row]
            best[row[counted & ~moves]] = least[counted & ~moves]
            go = counted & moves
            row, least, distance = row[go], least[go], distance[go]
            now, control, rates = (np.asfortranarray(each[go]) for each in (now, control, rates))
    best[row] = np.maximum(best[row], least)


def _length(vectors: Floats) -> Floats:
    """Euclidean length (B,) of vectors (B, n)."""
    return np.sqrt(np.einsum("bi,bi->b", vectors, vectors))


def _counted(constraints: Regions) -> Bools:
    """Which dimensions (n,) the signed distance to K depends on."""
    each = [_counts(constraints, region) for region in range(len(constraints))]
    return np.any(each, axis=0)


def _counts(constraints: Regions, region: int) -> Bools:
    """Which dimensions (n,) the signed distance to a region depends on."""
    space, (_, half) = constraints.space, middle_and_half(constraints.box(region))
    return np.isfinite(half) & ~(space.periodic & (2 * half >= space.bounds.widths))


def _least_on_chords(constraints: Regions, starts: Floats, ends: Floats) -> Floats:
    """A lower bound (B,) of dist_K along the straight ways from starts (B, n) to ends (B, n)."""
    least = np.full(len(starts), np.inf)
    for region in range(len(constraints)):
        least = np.minimum(least, _least_to_box(constraints, region, starts, ends))
    return least


def _least_to_box(constraints: Regions, region: int, starts: Floats, ends: Floats) -> Floats:
    """`_least_on_chords` for one region, by cuts: where two tangents meet the next one is taken."""
    counts, space = _counts(constraints, region), constraints.space
    middle, half = middle_and_half(constraints.box(region))
    half, chords = half[counts], (ends - starts)[:, counts]
    first = space.difference(starts, middle)[:, counts]
    last = space.difference(ends, middle)[:, counts]
    value, slope = _box_distance(first, half, chords)
    end_value, end_slope = _box_distance(last, half, chords)
    least = np.minimum(value, end_value)
    # Where the short way round changes sides the distance is not convex, but it is far.
    turned = np.any(np.abs(first + chords - last) > 1e-9 * space.bounds.widths[counts], axis=1)
    least[turned] = ((value + end_value - _length(chords)) / 2)[turned]
    rows = np.flatnonzero((slope < 0) & (end_slope > 0) & ~turned)
    first, chords = first[rows], chords[rows]
    low = np.stack([np.zeros(len(rows)), value[rows], slope[rows]])
    high = np.stack([np.ones(len(rows)), end_value[rows], end_slope[rows]])
    for cut in range(_CUTS + 1):
        # low and high hold a place on the chord, the distance there and its derivative.
        drop = high[1] - low[1] - high[2] * (high[0] - low[0])
        ahead = drop / (low[2] - high[2])
        if cut == _CUTS:
            break
        place = low[0] + ahead
        value, slope = _box_distance(first + place[:, None] * chords, half, chords)
        found = np.stack([place, value, slope])
        low, high = np.where(slope < 0, found, low), np.where(slope < 0, high, found)
    least[rows] = low[1] + low[2] * ahead
    return least


def _box_distance(offsets: Floats, half: Floats, chords: Floats) -> tuple[Floats, Floats]:
    """Signed distance (B,) at offsets (B, k) from a box's centre, and its rise (B,) by chords."""
    beyond = np.abs(offsets) - half
    outside = np.maximum(beyond, 0.0)
    away, deepest = _length(outside), np.argmax(beyond, axis=1)
    rows = np.arange(len(offsets))
    inside = away == 0
    outside[rows[inside], deepest[inside]] = 1.0  # the normal, times `away` where that is not 0
    rise = np.einsum("bi,bi->b", outside, np.sign(offsets) * chords)
    return (
        np.where(inside, beyond[rows, deepest], away),
        rise / np.where(inside, 1.0, away),
    )
