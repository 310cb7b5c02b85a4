"""The first and the last move of a trajectory that begins and ends at states, not at cells.

A demonstration starts at a state, and from there, not from the centre of its cell, the first move
flows. Its last move ends at the goal: the motion is bent, in proportion to time, so that it ends
at the nearest state of the goal region. Otherwise a region that holds the centre of a start or goal
cell would seem unavoidable, although the demonstration begins and ends outside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.simulate import rollout
from mlci.spaces import Bools, Box, Floats, Ints
from mlci.tabular import TabularModel, follow


@dataclass(frozen=True, eq=False)
class EndMoves:
    """L moves that may be taken, at one end of a trajectory.

    Attributes:
        cell: (L,) cell in which a move begins.
        successor: (L,) cell in which it ends.
        reward: (L,) its reward [nat].
        crosses: (L, C) which regions it enters.
    """

    cell: Ints
    successor: Ints
    reward: Floats
    crosses: Bools


def first_moves(model: TabularModel, start: Floats) -> EndMoves:
    """Every action from a state (n,), as far as it stays in the space and out of the truth."""
    origin = np.broadcast_to(start, (len(model.actions), len(start)))
    path = rollout(model.system, origin, model.actions[:, None, :], model.dt, model.substeps)
    reward = model.move_reward(origin, model.actions)
    cell = np.full(len(origin), model.grid.index(start))
    return _allowed(model, cell, path, reward)


def last_moves(model: TabularModel, cells: Ints, goal_cells: Ints, goal: Box) -> EndMoves:
    """The moves from some cells into the goal's cells, bent to end in the goal region."""
    into = model.allowed[cells] & np.isin(model.successor[cells], goal_cells)
    row, move = np.nonzero(into)
    cell = cells[row]
    origin, action = model.move_origins(cell, move), model.actions[model.action[move]]
    path = rollout(model.system, origin, action[:, None, :], model.dt, model.substeps)
    beyond = model.grid.space.excess(path[:, -1], goal)
    share = np.linspace(0, 1, path.shape[1])[:, None]
    return _allowed(model, cell, path - share * beyond[:, None, :], model.reward[cell, move])


def only_moves(model: TabularModel, start: Floats, goal_cells: Ints, goal: Box) -> EndMoves:
    """The moves of a trajectory of one step: from a state into the goal region."""
    origin = np.broadcast_to(start, (len(model.actions), len(start)))
    path = rollout(model.system, origin, model.actions[:, None, :], model.dt, model.substeps)
    into = np.isin(model.grid.index(path[:, -1]), goal_cells)
    path, origin, actions = path[into], origin[into], model.actions[into]
    beyond = model.grid.space.excess(path[:, -1], goal)
    share = np.linspace(0, 1, path.shape[1])[:, None]
    cell = np.full(len(path), model.grid.index(start))
    reward = model.move_reward(origin, actions)
    return _allowed(model, cell, path - share * beyond[:, None, :], reward)


def _allowed(model: TabularModel, cell: Ints, path: Floats, reward: Floats) -> EndMoves:
    """The moves with paths (L, K+1, n) that stay in the space and out of the truth."""
    successor, crossings = follow(model.grid, model.regions, path)
    crosses = np.asarray(crossings.toarray(), dtype=bool)
    may = (successor >= 0) & ~np.any(crosses[:, model.truth], axis=1)
    return EndMoves(cell[may], successor[may], reward[may], crosses[may])
