"""The maximum entropy distribution over tabular trajectories (section III-B) and what it implies.

A trajectory of T moves from a start cell into one of the goal cells has probability e^R / Z, (2).
Z is carried in log space: log_z[t, s] is the log of the sum of e^(reward to go) over all ways to
get from cell s at step t into a goal cell at step T, and -inf where there is none, where s cannot
be reached from the start in t moves, and so wherever no probability ever is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from mlci.mdp import TabularMDP
from mlci.spaces import Bools, Floats, Ints


def reachable(mdp: TabularMDP, start: int, steps: int) -> list[Ints]:
    """Cells that can be occupied after t = 0 .. steps allowed moves from a start cell."""
    cells = [np.array([start], dtype=np.int64)]
    for _ in range(steps):
        here = cells[-1]
        mark = np.zeros(mdp.states, dtype=bool)
        mark[mdp.successor[here][mdp.allowed[here]]] = True
        cells.append(np.flatnonzero(mark))
    return cells


def log_partition(mdp: TabularMDP, start: int, goals: ArrayLike, steps: int) -> Floats:
    """The soft Bellman backup: log Z of (2), or of (3) on `forbid(mdp, regions)`.

    Args:
        mdp: the MDP.
        start: start cell.
        goals: one goal cell, or several: the trajectory ends in any of them.
        steps: T.

    Returns:
        (T+1, S) log_z; log_z[0, start] is log Z, -inf if no trajectory reaches a goal.

    Raises:
        ValueError: a start that is no cell, such as the -1 of a state outside the grid.
    """
    if not 0 <= start < mdp.states:
        raise ValueError(f"the start must be a cell from 0 to {mdp.states - 1}, not {start}")
    cells = reachable(mdp, start, steps)
    log_z = np.full((steps + 1, mdp.states), -np.inf)
    ends = np.intersect1d(cells[steps], np.atleast_1d(goals))
    log_z[steps, ends] = 0.0
    for t in reversed(range(steps)):
        here = cells[t]
        value = _action_values(mdp, log_z[t + 1], here)
        best = np.max(value, axis=1)
        finite = best > -np.inf
        spread = np.sum(np.exp(value[finite] - best[finite, None]), axis=1)
        log_z[t, here[finite]] = best[finite] + np.log(spread)
    return log_z


def policy(mdp: TabularMDP, log_z: Floats, t: int) -> tuple[Ints, Floats]:
    """pi_t(move | s) = exp(reward + log_z[t+1, s'] - log_z[t, s]), the soft optimal policy.

    Returns:
        The cells (Q,) that carry probability at step t, and (Q, M) probabilities of their moves,
        whose rows sum to 1.
    """
    cells = np.flatnonzero(log_z[t] > -np.inf)
    chances = np.exp(_action_values(mdp, log_z[t + 1], cells) - log_z[t, cells, None])
    return cells, chances / np.sum(chances, axis=1, keepdims=True)


def violation_probabilities(mdp: TabularMDP, log_z: Floats, start: int) -> Floats:
    """Phi_(i,T) (C,): the probability that a trajectory from `start` crosses region i.

    phi_t^i(s) = sum over moves of pi_t(move | s) [1 if the move crosses i, else phi_(t+1)^i(s')],
    backwards from phi_T = 0: sums of products of probabilities, so nothing cancels. Moves with
    one successor are merged, and only the pairs of a cell and a region with a crossing move are
    then computed move by move.

    Raises:
        ValueError: no trajectory from `start` reaches a goal, so there is no distribution.
    """
    if log_z[0, start] == -np.inf:
        raise ValueError(f"no trajectory from cell {start} reaches a goal: Phi is not defined")
    steps, regions = len(log_z) - 1, mdp.crosses.shape[1]
    pair_cell, pair_region, pair_crossed = mdp.crossing_pairs
    row_of = np.zeros(mdp.states, dtype=np.int64)
    cells_after = np.flatnonzero(log_z[steps] > -np.inf)
    phi = np.zeros((len(cells_after), regions))
    for t in reversed(range(steps)):
        row_of[:] = -1
        row_of[cells_after] = np.arange(len(cells_after))
        cells, chances = policy(mdp, log_z, t)
        phi_after, phi = phi, _merged(mdp, cells, chances, row_of, len(cells_after)) @ phi
        row_now = np.full(mdp.states, -1, dtype=np.int64)
        row_now[cells] = np.arange(len(cells))
        pairs = np.flatnonzero(row_now[pair_cell] >= 0)
        if len(pairs):
            row, region = row_now[pair_cell[pairs]], pair_region[pairs]
            # A successor outside the support has probability 0: whichever row stands for it.
            after = phi_after[row_of[mdp.successor[pair_cell[pairs]]], region[:, None]]
            entered = np.where(pair_crossed[pairs], 1.0, after)
            phi[row, region] = np.einsum("pm,pm->p", chances[row], entered)
        cells_after = cells
    return np.asarray(np.minimum(phi[0], 1.0))


def expected_violations(
    mdp: TabularMDP, starts: Sequence[int], goals: Sequence[ArrayLike], steps: Sequence[int]
) -> tuple[Floats, Bools]:
    """Phi of several tasks.

    Args:
        mdp: the MDP.
        starts: N start cells.
        goals: N goals, each a cell or several.
        steps: N numbers of transitions.

    Returns:
        (N, C) violation probabilities, 0 where the goal cannot be reached; and (N,) whether it can.
    """
    phi = np.zeros((len(starts), mdp.crosses.shape[1]))
    reached = np.zeros(len(starts), dtype=bool)
    for j, (start, goal, count) in enumerate(zip(starts, goals, steps, strict=True)):
        log_z = log_partition(mdp, start, goal, count)
        reached[j] = log_z[0, start] > -np.inf
        if reached[j]:
            phi[j] = violation_probabilities(mdp, log_z, start)
    return phi, reached


def sample_moves(
    mdp: TabularMDP, log_z: Floats, start: int, count: int, rng: np.random.Generator
) -> tuple[Ints, Ints]:
    """Draw trajectories from (2) by following the soft optimal policy.

    Returns:
        (count, T+1) cells and (count, T) moves.

    Raises:
        ValueError: no trajectory from `start` reaches a goal.
    """
    if log_z[0, start] == -np.inf:
        raise ValueError(f"no trajectory from cell {start} reaches a goal: nothing to sample")
    cells = [np.full(count, start, dtype=np.int64)]
    moves = []
    for t in range(len(log_z) - 1):
        support, chances = policy(mdp, log_z, t)
        cumulative = np.cumsum(chances[np.searchsorted(support, cells[-1])], axis=1)
        # Scaled by the last entry, so that rounding cannot lift a draw past every move.
        draws = rng.random(count)[:, None] * cumulative[:, -1:]
        moves.append(np.argmax(cumulative > draws, axis=1))
        cells.append(mdp.successor[cells[-1], moves[-1]])
    return np.stack(cells, axis=1), np.stack(moves, axis=1)


def _action_values(mdp: TabularMDP, log_z_after: Floats, cells: Ints) -> Floats:
    """(Q, M) reward + log_z[t+1, s'] of the moves of `cells`, -inf where not allowed."""
    value = mdp.reward[cells] + log_z_after[mdp.successor[cells]]
    return np.where(mdp.allowed[cells], value, -np.inf)


def _merged(
    mdp: TabularMDP, cells: Ints, chances: Floats, row_of: Ints, rows_after: int
) -> sparse.csr_matrix:
    """(Q, rows_after) transition probabilities, the moves to one successor added up."""
    order, successor, begins = mdp.by_successor
    order, successor, begins = order[cells], successor[cells], begins[cells]
    first = np.flatnonzero(begins)
    weight = np.add.reduceat(np.take_along_axis(chances, order, axis=1).ravel(), first)
    column = row_of[successor.ravel()[first]]
    ends = np.append(0, np.cumsum(np.sum(begins, axis=1)))
    return sparse.csr_matrix(
        (np.where(column >= 0, weight, 0.0), np.maximum(column, 0), ends),
        shape=(len(cells), rows_after),
    )
