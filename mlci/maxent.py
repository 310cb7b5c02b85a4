"""The maximum entropy distribution over tabular trajectories (section III-B) and what it implies.

A trajectory of T moves from a start cell into one of the goal cells has probability e^R / Z, (2).
Z is carried in log space: log_z[t, s] is the log of the sum of e^(reward to go) over all ways to
get from cell s at step t into a goal cell at step T, and -inf where there is none, where s cannot
be reached from the start in t moves, and so wherever no probability ever is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from mlci.mdp import Progress, TabularMDP
from mlci.spaces import Bools, Floats, Ints

_CELLS_AT_ONCE = 1 << 12  # whose moves a step of work holds
PHI_BYTES = 1 << 29  # of violation probabilities held at once, else regions go block by block


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
        for here in _parts(cells[t]):
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
    return cells, _chances(mdp, log_z, t, cells)


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
    regions = mdp.crosses.shape[1]
    support = int(np.max(np.sum(log_z > -np.inf, axis=1)))
    blocks = min(regions, -(-regions * 2 * 8 * support // PHI_BYTES))
    edges = np.linspace(0, regions, max(1, blocks) + 1).astype(int)
    phi = np.empty(regions)
    for first, last in pairwise(edges):
        phi[first:last] = _block_of_phi(mdp, log_z, first, last)
    return np.minimum(phi, 1.0)


def _block_of_phi(mdp: TabularMDP, log_z: Floats, first: int, last: int) -> Floats:
    """Phi of the regions from `first` to before `last`, of the one cell that log_z starts in."""
    begins, pair_region, pair_crossed = mdp.crossing_pairs
    steps = len(log_z) - 1
    row_of = np.zeros(mdp.states, dtype=np.int64)
    cells_after = np.flatnonzero(log_z[steps] > -np.inf)
    phi = np.zeros((len(cells_after), last - first))
    for t in reversed(range(steps)):
        row_of[:] = -1
        row_of[cells_after] = np.arange(len(cells_after))
        cells = np.flatnonzero(log_z[t] > -np.inf)
        phi_after, phi = phi, np.empty((len(cells), last - first))
        row = 0
        for here in _parts(cells):
            chances = _chances(mdp, log_z, t, here)
            now = _merged(mdp, here, chances, row_of, len(cells_after)) @ phi_after
            counts = begins[here + 1] - begins[here]
            owner = np.repeat(np.arange(len(here)), counts)
            begin = begins[here] - np.cumsum(counts) + counts
            pair = np.arange(len(owner)) + np.repeat(begin, counts)
            region = pair_region[pair] - first
            wanted = (region >= 0) & (region < last - first)
            owner, pair, region = owner[wanted], pair[wanted], region[wanted]
            if len(pair):
                # A successor outside the support has probability 0: whichever row stands for it.
                after = phi_after[row_of[mdp.successor[here[owner]]], region[:, None]]
                entered = np.where(pair_crossed[pair], 1.0, after)
                now[owner, region] = np.einsum("pm,pm->p", chances[owner], entered)
            phi[row : row + len(here)] = now
            row += len(here)
        cells_after = cells
    return phi[0]


def expected_violations(
    mdp: TabularMDP,
    starts: Sequence[int],
    goals: Sequence[ArrayLike],
    steps: Sequence[int],
    progress: Progress | None = None,
) -> tuple[Floats, Bools]:
    """Phi of several tasks.

    Args:
        mdp: the MDP.
        starts: N start cells.
        goals: N goals, each a cell or several.
        steps: N numbers of transitions.
        progress: is told how many tasks are done, and of how many.

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
        if progress is not None:
            progress(j + 1, len(starts))
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


def _parts(cells: Ints) -> Iterator[Ints]:
    """Cells in parts whose moves fit into memory and cache."""
    for first in range(0, len(cells), _CELLS_AT_ONCE):
        yield cells[first : first + _CELLS_AT_ONCE]


def _chances(mdp: TabularMDP, log_z: Floats, t: int, cells: Ints) -> Floats:
    """(Q, M) probabilities of the moves of cells that carry probability at step t."""
    chances = np.exp(_action_values(mdp, log_z[t + 1], cells) - log_z[t, cells, None])
    return np.asarray(chances / np.sum(chances, axis=1, keepdims=True))


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
