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

from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import Progress, TabularMDP

_CELLS_AT_ONCE = 1 << 12  # whose moves a step of work holds
PHI_BYTES = 1 << 29  # of violation probabilities held at once, else regions go block by block


def reachable(mdp: TabularMDP, start: int, steps: int) -> list[Ints]:
    """Cells that can be occupied after t = 0 .. steps allowed moves from a start cell."""
    cells = [np.array([start], dtype=np.int64)]
    for _ in range(steps):
        way, _ = _ways_of(mdp, cells[-1])
        mark = np.zeros(mdp.states, dtype=bool)
        mark[mdp.ways.successor[way[mdp.ways.log_weight[way] > -np.inf]]] = True
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
        for here in _parts(mdp, cells[t]):
            way, ends = _ways_of(mdp, here)
            value = mdp.ways.log_weight[way] + log_z[t + 1, mdp.ways.successor[way]]
            best = np.maximum.reduceat(value, ends[:-1])
            finite = best > -np.inf
            shift = np.repeat(np.where(finite, best, 0.0), np.diff(ends))
            spread = np.add.reduceat(np.exp(value - shift), ends[:-1])
            log_z[t, here[finite]] = best[finite] + np.log(spread[finite])
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
    backwards from phi_T = 0. Computed as sum of pi_t phi_(t+1)^i(s') over all moves, those with
    one successor merged, and then pi_t (1 - phi_(t+1)^i(s')) added for each move that crosses i:
    all terms are at least 0, so nothing cancels.

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
    ways, steps = mdp.ways, len(log_z) - 1
    row_of = np.zeros(mdp.states, dtype=np.int64)
    cells_after = np.flatnonzero(log_z[steps] > -np.inf)
    phi = np.zeros((len(cells_after), last - first))
    for t in reversed(range(steps)):
        row_of[:] = -1
        row_of[cells_after] = np.arange(len(cells_after))
        cells = np.flatnonzero(log_z[t] > -np.inf)
        phi_after, phi = phi, np.empty((len(cells), last - first))
        row = 0
        for here in _parts(mdp, cells):
            way, ends = _ways_of(mdp, here)
            column = row_of[ways.successor[way]]
            value = ways.log_weight[way] + log_z[t + 1, ways.successor[way]]
            chance = np.exp(value - np.repeat(log_z[t, here], np.diff(ends)))
            chance /= np.repeat(np.add.reduceat(chance, ends[:-1]), np.diff(ends))
            # A successor outside the support has probability 0: whichever row stands for it.
            column = np.maximum(column, 0)
            moved = sparse.csr_matrix((chance, column, ends), shape=(len(here), len(cells_after)))
            now = moved @ phi_after
            owner, entry, region = _of_cells(
                ways.crossing_begins, ways.crossing_region, here, first, last
            )
            place = ways.crossing_way[entry] - ways.begins[here[owner]] + ends[owner]
            lacking = chance[place] * (1.0 - phi_after[column[place], region])
            np.add.at(now.reshape(-1), owner * (last - first) + region, lacking)
            owner, _, region = _of_cells(
                ways.certain_begins, ways.certain_region, here, first, last
            )
            now[owner, region] = 1.0
            phi[row : row + len(here)] = now
            row += len(here)
        cells_after = cells
    return phi[0]


def _of_cells(
    begins: Ints, regions: Ints, cells: Ints, first: int, last: int
) -> tuple[Ints, Ints, Ints]:
    """Entries of some cells whose regions are from `first` to before `last`.

    Returns the place in `cells` that each belongs to, its own number, and its region less `first`.
    """
    entry, ends = _ranges(begins, cells)
    owner = np.repeat(np.arange(len(cells)), np.diff(ends))
    region = regions[entry] - first
    wanted = (region >= 0) & (region < last - first)
    if wanted.all():
        return owner, entry, region
    return owner[wanted], entry[wanted], region[wanted]


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
        here, place = np.unique(cells[-1], return_inverse=True)
        cumulative = np.cumsum(_chances(mdp, log_z, t, here)[place], axis=1)
        # Scaled by the last entry, so that rounding cannot lift a draw past every move.
        draws = rng.random(count)[:, None] * cumulative[:, -1:]
        moves.append(np.argmax(cumulative > draws, axis=1))
        cells.append(mdp.successor[cells[-1], moves[-1]])
    return np.stack(cells, axis=1), np.stack(moves, axis=1)


def _parts(mdp: TabularMDP, cells: Ints) -> Iterator[Ints]:
    """Cells that some way leaves, in parts whose ways fit into memory and cache."""
    left = cells[mdp.ways.begins[cells + 1] > mdp.ways.begins[cells]]
    for first in range(0, len(left), _CELLS_AT_ONCE):
        yield left[first : first + _CELLS_AT_ONCE]


def _ways_of(mdp: TabularMDP, cells: Ints) -> tuple[Ints, Ints]:
    """The ways of some cells, one cell after the other, and (Q+1,) where those of each begin."""
    return _ranges(mdp.ways.begins, cells)


def _ranges(begins: Ints, cells: Ints) -> tuple[Ints, Ints]:
    """The numbers from begins[s] to before begins[s+1] of some cells s, and where each begin."""
    counts = begins[cells + 1] - begins[cells]
    ends = np.append(0, np.cumsum(counts))
    return np.arange(ends[-1]) + np.repeat(begins[cells] - ends[:-1], counts), ends


def _chances(mdp: TabularMDP, log_z: Floats, t: int, cells: Ints) -> Floats:
    """(Q, M) probabilities of the moves of cells that carry probability at step t."""
    chances = np.exp(_action_values(mdp, log_z[t + 1], cells) - log_z[t, cells, None])
    return np.asarray(chances / np.sum(chances, axis=1, keepdims=True))


def _action_values(mdp: TabularMDP, log_z_after: Floats, cells: Ints) -> Floats:
    """(Q, M) reward + log_z[t+1, s'] of the moves of `cells`, -inf where not allowed."""
    value = mdp.reward[cells] + log_z_after[mdp.successor[cells]]
    return np.where(mdp.allowed[cells], value, -np.inf)
