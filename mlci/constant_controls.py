"""The safe set without an equation: what the best constant extremal control achieves.

V(x) is at least the largest, over the corners u of the control box, of the smallest signed distance
to K along the motion that holds u:

    v(x) = max_u min_{0 <= t <= horizon} dist_K(x_u(t)).

Where v >= 0 a control that avoids K is known, so {v >= 0} lies inside Omega (10), and holding that
control keeps v from falling. A grid only tabulates v: it adds an error of interpolation, but no
numerical diffusion, which on the coarse grids that four dimensions allow moves the border of the
equation's solution (9) by more than a cell, and to the unsafe side.

Motions stop at the bounds of the state space and slide along them, as in `mlci.reachability`.
"""

from __future__ import annotations

import numpy as np

from mlci.grids import Grid
from mlci.reachability import SafeSet
from mlci.regions import Regions
from mlci.simulate import rk4_step, step_count
from mlci.spaces import Floats
from mlci.systems import System

_AT_ONCE = 1 << 14  # states; more do not stay in the cache
_STEPS_BETWEEN = 8  # steps after which motions that cannot matter any more are dropped


def escape_value(
    system: System, constraints: Regions, states: Floats, horizon: float, step: float
) -> Floats:
    """v (B,) at states (B, n), in the unit of dist_K.

    Args:
        system: the dynamics and the control box.
        constraints: K.
        states: (B, n) where the motions begin.
        horizon: for how long they last [s].
        step: time between the samples at which the distance is taken [s]; divides the horizon.
    """
    steps = step_count(horizon, step)
    parts = [np.empty(0)]
    for first in range(0, len(states), _AT_ONCE):
        part = states[first : first + _AT_ONCE]
        parts.append(_best(system, constraints, part, steps, step))
    return np.concatenate(parts)


def _best(system: System, constraints: Regions, states: Floats, steps: int, step: float) -> Floats:
    """v (B,) of one block of states."""
    space = system.space
    lower = np.where(space.periodic, -np.inf, space.bounds.lower)
    upper = np.where(space.periodic, np.inf, space.bounds.upper)
    now_distance = constraints.signed_distance(states)
    best = np.full(len(states), -np.inf)
    for control in system.control_box.vertices():
        # A motion counts as long as it is better than the best, which is at most the distance now.
        open_ = np.flatnonzero(best < now_distance)
        now, least = states[open_], now_distance[open_]
        for k in range(steps):
            now = np.clip(rk4_step(system, now, control, step), lower, upper)
            least = np.minimum(least, constraints.signed_distance(now))
            if k % _STEPS_BETWEEN == 0:
                better = least > best[open_]
                open_, now, least = open_[better], now[better], least[better]
        best[open_] = np.maximum(best[open_], least)
    return best


def tabulate_escapes(
    system: System, grid: Grid, constraints: Regions, *, horizon: float, step: float = 0.05
) -> SafeSet:
    """Tabulate v at the cell centres of a grid; see the module's head and `escape_value`."""
    values = escape_value(system, constraints, grid.centers, horizon, step)
    return SafeSet.from_values(grid, values)
