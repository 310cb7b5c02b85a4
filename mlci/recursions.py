"""The recursions of the maximum entropy distribution, over arrays indexed by step and cell.

log_z[t, s] is the log of the sum of e^(reward to go) over all ways to get from cell s at step t
into a goal cell at step T, and -inf where there is none or where s cannot be occupied.
alpha_t(s, i) is the probability of avoiding region i from there on, of cells with finite
log_z[t, s].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from mlci.compiled import compiled
from mlci.merged_moves import MergedMoves
from mlci.spaces import Bools, Floats, Ints

ALPHA_BYTES = 1 << 29  # of probabilities held at once, else regions go block by block

# Moves, and the steps from which and to which they are taken.
Leg = tuple[MergedMoves, int, int]


def reachable_cells(moves: MergedMoves, starts: Ints | Sequence[int], steps: int) -> Bools:
    """(T+1, S) whether a cell can be occupied after t = 0 .. T moves from some of the starts."""
    reached = np.zeros((steps + 1, moves.states), dtype=bool)
    reached[0, starts] = True
    _spread(moves.begins, moves.successor, moves.log_weight, reached)
    return reached


def backward_pass(
    legs: Sequence[Leg], reachable: Bools, goal: Ints, start: int, regions: int, skip: int = 0
) -> tuple[Floats, Floats]:
    """log_z (T+1, S) [nat] of reachable cells (T+1, S), and alpha_0 (C - skip,) of the start.

    Args:
        legs: the moves of each part of the way, in order.
        reachable: see `reachable_cells`; a goal among the last ones.
        goal: (G,) the goal cells.
        start: the start cell.
        regions: C, the number of regions; 0 takes log_z alone.
        skip: how many of the first regions to leave out.
    """
    states, last = reachable.shape[1], len(reachable) - 1
    log_z = np.full(reachable.shape, -np.inf)
    log_z[last, goal[reachable[last, goal]]] = 0.0
    count = regions - skip
    blocks = max(1, min(count, -(-count * 2 * 8 * states // ALPHA_BYTES)))
    alpha = np.empty(count)
    for first, end in pairwise(skip + count * block // blocks for block in range(blocks + 1)):
        levels = np.empty((2, states, end - first))  # alpha_t is levels[t % 2]
        levels[last % 2, goal] = 1.0
        for moves, early, late in reversed(legs):
            arrays = moves.begins, moves.successor, moves.log_weight
            crossings = moves.crossing_begins, moves.crossing_region
            _step_back(*arrays, *crossings, reachable, early, late, log_z, first, levels)
        alpha[first - skip : end - skip] = levels[0, start]
    return log_z, np.minimum(alpha, 1.0)


def backward_levels(
    legs: Sequence[Leg], reachable: Bools, goal: Ints, regions: int
) -> Iterator[tuple[int, Floats]]:
    """Each step t from T back to 0, and alpha_t (S, C), which the next one overwrites.

    Args as of `backward_pass`; alpha of cells that cannot be occupied has no meaning.
    """
    states, last = reachable.shape[1], len(reachable) - 1
    log_z = np.full(reachable.shape, -np.inf)
    log_z[last, goal[reachable[last, goal]]] = 0.0
    levels = np.zeros((2, states, regions))  # numbers, so that who subtracts is not warned
    levels[last % 2, goal] = 1.0
    yield last, levels[last % 2]
    for moves, early, late in reversed(legs):
        arrays = moves.begins, moves.successor, moves.log_weight
        crossings = moves.crossing_begins, moves.crossing_region
        for t in range(late - 1, early - 1, -1):
            _step_back(*arrays, *crossings, reachable, t, t + 1, log_z, 0, levels)
            yield t, levels[t % 2]


def forward_pass(legs: Sequence[Leg], log_z: Floats, start: int) -> Floats:
    """(T+1, S) probability of being in each cell at each step.

    Args:
        legs: the moves of each part of the way, in order.
        log_z: (T+1, S), see `backward_pass`; finite at the start.
        start: the start cell.
    """
    states = log_z.shape[1]
    occupied = np.zeros(log_z.shape)
    occupied[0, start] = 1.0
    for moves, early, late in legs:
        cell, successor = np.repeat(np.arange(states), np.diff(moves.begins)), moves.successor
        for t in range(early, late):
            value = moves.log_weight + log_z[t + 1, successor]
            on = np.flatnonzero((occupied[t, cell] > 0) & (value > -np.inf))
            flow = occupied[t, cell[on]] * np.exp(value[on] - log_z[t, cell[on]])
            occupied[t + 1] = np.bincount(successor[on], weights=flow, minlength=states)
    return occupied


@compiled("void(in i8[::1], in i4[::1], in f8[::1], b1[:, ::1])")
def _spread(begins: Ints, successor: Ints, log_weight: Floats, reached: Bools) -> None:
    """Fill in which cells are reached (T+1, S) after each step, from those at step 0."""
    for t in range(reached.shape[0] - 1):
        for s in range(reached.shape[1]):
            if reached[t, s]:
                for k in range(begins[s], begins[s + 1]):
                    if log_weight[k] > -np.inf:
                        reached[t + 1, successor[k]] = True


@compiled(
    "void(in i8[::1], in i4[::1], in f8[::1], in i8[::1], in i4[::1], in b1[:, ::1], i8, i8, "
    "f8[:, ::1], i8, f8[:, :, ::1])"
)
def _step_back(
    begins: Ints,
    successor: Ints,
    log_weight: Floats,
    crossing_begins: Ints,
    crossing_region: Ints,
    reachable: Bools,
    early: int,
    late: int,
    log_z: Floats,
    first: int,
    levels: Floats,
) -> None:
    """Both recursions, from step late - 1 back to step early, over the merged moves k of a cell.

    log_z[t, s] = log sum_k e^v[k], with v[k] = log_weight[k] + log_z[t+1, s'_k], fills log_z
    (T+1, S) where `reachable`. alpha_t(s, i) = sum_k pi(k) alpha_(t+1)(s'_k, i) over those that do
    not cross region i, with pi(k) = e^v[k] / sum_j e^v[j], fills levels[t % 2] (S, C') of the
    regions from `first` on: what k would add to those that it crosses is taken back.
    """
    regions, most = levels.shape[2], 0
    for s in range(log_z.shape[1]):
        most = max(most, begins[s + 1] - begins[s])
    value, kept = np.empty(most), np.empty(regions)
    for t in range(late - 1, early - 1, -1):
        for s in range(log_z.shape[1]):
            if not reachable[t, s]:
                continue
            best, total, begin = -np.inf, 0.0, begins[s]
            for k in range(begin, begins[s + 1]):
                value[k - begin] = log_weight[k] + log_z[t + 1, successor[k]]
                best = max(best, value[k - begin])
            if best == -np.inf:
                continue
            here = levels[t % 2, s]
            here[:] = 0.0
            for k in range(begin, begins[s + 1]):
                if value[k - begin] == -np.inf:
                    continue
                weight = np.exp(value[k - begin] - best)
                total += weight
                if regions == 0:
                    continue
                there = levels[(t + 1) % 2, successor[k]]
                for entry in range(crossing_begins[k], crossing_begins[k + 1]):
                    region = crossing_region[entry] - first
                    if 0 <= region < regions:
                        kept[region] = here[region]
                for i in range(regions):
                    here[i] += weight * there[i]
                for entry in range(crossing_begins[k], crossing_begins[k + 1]):
                    region = crossing_region[entry] - first
                    if 0 <= region < regions:
                        here[region] = kept[region]
            log_z[t, s] = best + np.log(total)
            for i in range(regions):
                here[i] /= total


def move_probabilities(
    successor: Ints, reward: Floats, log_z: Floats, t: int, cells: Ints
) -> Floats:
    """(Q, M) probabilities of moves (Q, M) of cells that carry probability at step t.

    The reward of a move that is not allowed is -inf.
    """
    probabilities = np.exp(reward + log_z[t + 1, successor] - log_z[t, cells, None])
    return np.asarray(probabilities / np.sum(probabilities, axis=1, keepdims=True))
