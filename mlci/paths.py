"""Paths of moves: how finely they are integrated, where they end and what they cross."""

from __future__ import annotations

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.cells.protocol import Cells
from mlci.regions import Regions
from mlci.spaces import Floats, Ints
from mlci.systems import System

_CHORD_ERROR = 0.01  # of a cell's width: how far a chord may stray from the curve it stands for
PATHS_AT_ONCE = 1 << 13  # which the second level of cache nearly holds


def substep_count(system: System, grid: Cells, actions: Floats, dt: float) -> int:
    """Integrator steps a move, so that chords stay close to the curve they stand for.

    A chord over time t strays |x''| t^2 / 8 from its curve, with x'' = dh/dx h under a held
    control; and no chord may span a quarter of a period, for the short way round to be its own.
    """
    shortest = dt
    quarter = np.where(grid.space.periodic, grid.space.bounds.widths / 4, np.inf)
    controls, parts = actions[:, None, :], 1 + grid.size * len(actions) // PATHS_AT_ONCE
    for cells in np.array_split(np.arange(grid.size), min(parts, grid.size)):
        states = grid.points_inside(1, cells)[:, 0]
        speed = system.dynamics(states, controls)
        by_state, _ = system.jacobians(states, controls)
        bend = np.max(np.abs(np.einsum("...ij,...j->...i", by_state, speed)), axis=(0, 1))
        with np.errstate(divide="ignore"):
            shortest = min(
                shortest,
                float(np.min(np.sqrt(8 * _CHORD_ERROR * grid.widths / bend))),
                float(np.min(quarter / np.max(np.abs(speed), axis=(0, 1)))),
            )
    return int(np.ceil(dt / shortest - 1e-9))


def follow(grid: Cells, regions: Regions, path: Floats) -> tuple[Ints, scipy.sparse.csr_matrix]:
    """Successor (-1 where the path leaves the space) and crossings of paths (Q, K+1, n)."""
    stays = np.all(grid.space.contains(path), axis=-1)
    successor = np.where(stays, grid.index(path[:, -1]), -1)
    return successor, regions.crossings(path[:, :-1], np.diff(path, axis=1), stays)
