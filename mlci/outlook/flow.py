"""How far controls reach within a time step, and how the flow stretches over a task."""

from __future__ import annotations

import numpy as np

from mlci.demonstrations import Demonstration
from mlci.grids import Grid
from mlci.spaces import Box, Floats
from mlci.systems import System


def control_reach(system: System, grid: Grid, range_of_controls: Box, dt: float) -> Floats:
    """(n,) cells that the range of controls spans after a time step, the mean over cells.

    By the dynamics linearised at each cell's centre: x' = A x + B u moves the state by Gamma u with
    Gamma = (dt + A dt^2 / 2 + A^2 dt^3 / 6 + A^3 dt^4 / 24) B, the head of the series of
    int_0^dt e^(A s) ds B. Less than a cell in some dimension: within a step no action decides about
    the cell there.

    Args:
        range_of_controls: (m,) the range of the actions.
        dt: time step [s].
    """
    middle = (range_of_controls.lower + range_of_controls.upper) / 2
    drift, push = system.jacobians(grid.centers, np.broadcast_to(middle, (grid.size, len(middle))))
    term, total = push * dt, push * dt
    for order in (2, 3, 4):
        term = drift @ term * (dt / order)
        total = total + term
    spans = np.abs(total) @ range_of_controls.widths
    return np.asarray(np.mean(spans, axis=0) / grid.widths)


def flow_expansion(system: System, path: Demonstration) -> float:
    """log of the most by which the flow along a path stretches a small difference of states.

    Differences are shares of the ranges of the dimensions, so that it has no unit. It is the
    largest singular value of the product of e^(A dt) along the path, each to second order.

    Raises:
        ValueError: a path without controls or times.
    """
    if path.controls is None or path.times is None:
        raise ValueError(f"{path.name}: the expansion of a flow needs controls and times")
    steps = np.diff(path.times)[:, None, None]
    drift, _ = system.jacobians(path.states[:-1], path.controls)
    n = path.states.shape[-1]
    factors = np.eye(n) + drift * steps + drift @ drift * (steps**2 / 2)
    stretch = np.eye(n)
    for factor in factors:
        stretch = factor @ stretch
    widths = system.space.bounds.widths
    return float(np.log(np.linalg.norm(stretch * widths / widths[:, None], ord=2)))
