"""The first and the last move of a trajectory that begins and ends at states, not at cells.

A demonstration starts at a state, and from there, not from the centre of its cell, the first move
flows. Its last move ends at the goal: the motion is bent, in proportion to time, so that it ends
at the nearest state of the goal region. Otherwise a region that holds the centre of a start or goal
cell would seem unavoidable, although the demonstration begins and ends outside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.merged_moves import MergedMoves
from mlci.paths import follow
from mlci.simulate import rollout
from mlci.spaces import Box, Floats, Ints
from mlci.tabular import TabularModel

# Of L moves: the cell (L,) that each begins in, its action (L,), its reward (L,) [nat] and its path
# (L, K+1, n).
MovePaths = tuple[Ints, Ints, Floats, Floats]


def first_moves(model: TabularModel, start: Floats) -> MergedMoves:
    """Every action from a state (n,), as far as it stays in the space and out of the truth."""
    return allowed_moves(model, [first_paths(model, start)])


def last_moves(model: TabularModel, cells: Ints, goal_cells: Ints, goal: Box) -> MergedMoves:
    """The moves from some cells, in order, into the goal's cells, bent to end in the goal."""
    return allowed_moves(model, last_paths(model, cells, goal_cells, goal))


def only_moves(model: TabularModel, start: Floats, goal_cells: Ints, goal: Box) -> MergedMoves:
    """The moves of a trajectory of one step: from a state into the goal region."""
    return allowed_moves(model, [only_paths(model, start, goal_cells, goal)])


def first_paths(model: TabularModel, start: Floats) -> MovePaths:
    """The paths of all actions from a state (n,)."""
    origin = np.broadcast_to(start, (len(model.actions), len(start)))
    path = rollout(model.system, origin, model.actions[:, None, :], model.dt, model.substeps)
    cell = np.full(len(origin), model.grid.index(start))
    reward = model.move_reward(origin, model.actions)
    return cell, np.arange(len(origin)), reward, path


def last_paths(
    model: TabularModel, cells: Ints, goal_cells: Ints, goal: Box
) -> Iterator[MovePaths]:
    """The paths of `last_moves`, block by block."""
    for block in model.blocks(np.intersect1d(cells, model.merged.cells_into(goal_cells))):
        # Whether the truth allows a move is seen on the bent path.
        moves = model.moves_of(block)
        row, move = np.nonzero(np.isin(moves.successor, goal_cells))
        origin, action = model.move_origins(block[row], move), model.action[move]
        applied = model.actions[action][:, None, :]
        path = rollout(model.system, origin, applied, model.dt, model.substeps)
        yield block[row], action, moves.reward[row, move], _bent(model, path, goal)


def only_paths(model: TabularModel, start: Floats, goal_cells: Ints, goal: Box) -> MovePaths:
    """The paths of `only_moves`."""
    cell, action, reward, path = first_paths(model, start)
    into = np.isin(model.grid.index(path[:, -1]), goal_cells)
    return cell[into], action[into], reward[into], _bent(model, path[into], goal)


def _bent(model: TabularModel, path: Floats, goal: Box) -> Floats:
    """Paths (L, K+1, n), moved in proportion to time so that they end in the goal region."""
    beyond = model.grid.space.excess(path[:, -1], goal)
    share = np.linspace(0, 1, path.shape[1])[:, None]
    return path - share * beyond[:, None, :]


def allowed_moves(model: TabularModel, parts: Iterable[MovePaths]) -> MergedMoves:
    """L moves by their paths, in order of cell; those that leave the space or cross the truth are
    forbidden.

    None is merged with another.
    """
    followed = [
        (cell, reward, *follow(model.grid, model.regions, path)) for cell, _, reward, path in parts
    ]
    cell, reward, successor = (np.concatenate([part[i] for part in followed]) for i in range(3))
    crosses = scipy.sparse.vstack([part[3] for part in followed], format="csr")
    forbidden = (successor < 0) | (crosses @ model.truth)
    return MergedMoves(
        begins=np.searchsorted(cell, np.arange(model.states + 1)),
        successor=np.where(forbidden, 0, successor).astype(np.int32),
        log_weight=np.where(forbidden, -np.inf, reward),
        crossing_begins=crosses.indptr.astype(np.int64),
        crossing_region=crosses.indices.astype(np.int32),
    )
