"""The recursions of the maximum entropy distribution, over arrays indexed by step and cell.

log_z[t, s] is the log of the sum of e^(reward to go) over all ways to get from cell s at step t
into a goal cell at step T, and -inf where there is none or where s cannot be occupied.
alpha_t(s, i) is the probability of avoiding region i from there on, of cells with finite
log_z[t, s].
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from mlci.compiled import compiled
from mlci.merged_moves import MergedMoves
from mlci.single_moves import SingleMoves
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


def log_z_to_go(legs: Sequence[Leg], reachable: Bools, goal: Ints) -> Floats:
    """log_z (T+1, S) [nat] into the goal cells (G,), of cells that are reachable (T+1, S)."""
    log_z = np.full(reachable.shape, -np.inf)
    log_z[-1, goal[reachable[-1, goal]]] = 0.0
    for moves, early, late in reversed(legs):
        arrays = moves.begins, moves.successor, moves.log_weight
        _soft_bellman(*arrays, reachable, early, late, log_z)
    return log_z


def avoidance(legs: Sequence[Leg], log_z: Floats, start: int, regions: int) -> Floats:
    """alpha_0 (C,) of the start cell."""
    steps, states = len(log_z) - 1, log_z.shape[1]
    blocks = max(1, min(regions, -(-regions * 2 * 8 * states // ALPHA_BYTES)))
    alpha = np.empty(regions)
    for first, last in pairwise(np.linspace(0, regions, blocks + 1).astype(int).tolist()):
        of_two_steps = np.empty((2, states, last - first))
        of_two_steps[steps % 2, log_z[steps] > -np.inf] = 1.0
        for moves, early, late in reversed(legs):
            arrays = moves.begins, moves.successor, moves.log_weight
            crossings = moves.crossing_begins, moves.crossing_region
            _avoid(*arrays, *crossings, log_z, early, late, first, of_two_steps)
        alpha[first:last] = of_two_steps[0, start]
    return np.minimum(alpha, 1.0)


@compiled("void(i8[::1], i4[::1], f8[::1], b1[:, ::1])")
def _spread(begins: Ints, successor: Ints, log_weight: Floats, reached: Bools) -> None:
    """Fill in which cells are reached (T+1, S) after each step, from those at step 0."""
    for t in range(reached.shape[0] - 1):
        for s in range(reached.shape[1]):
            if reached[t, s]:
                for k in range(begins[s], begins[s + 1]):
                    if log_weight[k] > -np.inf:
                        reached[t + 1, successor[k]] = True


@compiled("void(i8[::1], i4[::1], f8[::1], b1[:, ::1], i8, i8, f8[:, ::1])")
def _soft_bellman(
    begins: Ints,
    successor: Ints,
    log_weight: Floats,
    reachable: Bools,
    early: int,
    late: int,
    log_z: Floats,
) -> None:
    """log_z[t, s] = log sum_k e^(log_weight[k] + log_z[t+1, s'_k]), for t from late - 1 to early.

    The sum is over the merged moves k of cell s; log_z (T+1, S) is filled in where `reachable`.
    """
    for t in range(late - 1, early - 1, -1):
        for s in range(log_z.shape[1]):
            if not reachable[t, s]:
                continue
            best = -np.inf
            for k in range(begins[s], begins[s + 1]):
                best = max(best, log_weight[k] + log_z[t + 1, successor[k]])
            if best == -np.inf:
                continue
            total = 0.0
            for k in range(begins[s], begins[s + 1]):
                value = log_weight[k] + log_z[t + 1, successor[k]]
                if value > -np.inf:
                    total += np.exp(value - best)
            log_z[t, s] = best + np.log(total)


@compiled(
    "void(i8[::1], i4[::1], f8[::1], i8[::1], i4[::1], f8[:, ::1], i8, i8, i8, f8[:, :, ::1])"
)
def _avoid(
    begins: Ints,
    successor: Ints,
    log_weight: Floats,
    crossing_begins: Ints,
    crossing_region: Ints,
    log_z: Floats,
    early: int,
    late: int,
    first: int,
    alpha: Floats,
) -> None:
    """alpha_t(s, i) = sum_k pi_t(k | s) alpha_(t+1)(s'_k, i), for t from late - 1 to early.

    The sum is over the merged moves k of cell s that do not cross region i: the entries of regions
    that k crosses are put back to what they were. alpha (2, S, C') holds step t at t % 2, of the
    regions from `first` on.
    """
    regions = alpha.shape[2]
    kept = np.empty(regions)
    for t in range(late - 1, early - 1, -1):
        for s in range(log_z.shape[1]):
            if log_z[t, s] == -np.inf:
                continue
            here, total = alpha[t % 2, s], 0.0
            here[:] = 0.0
            for k in range(begins[s], begins[s + 1]):
                value = log_weight[k] + log_z[t + 1, successor[k]]
                if value == -np.inf:
                    continue
                probability = np.exp(value - log_z[t, s])
                total += probability
                there = alpha[(t + 1) % 2, successor[k]]
                for entry in range(crossing_begins[k], crossing_begins[k + 1]):
                    region = crossing_region[entry] - first
                    if 0 <= region < regions:
                        kept[region] = here[region]
                for i in range(regions):
                    here[i] += probability * there[i]
                for entry in range(crossing_begins[k], crossing_begins[k + 1]):
                    region = crossing_region[entry] - first
                    if 0 <= region < regions:
                        here[region] = kept[region]
            for i in range(regions):
                here[i] /= total


def move_probabilities(
    moves: SingleMoves, truth: Bools, log_z: Floats, t: int, cells: Ints
) -> Floats:
    """(Q, M) probabilities of the moves of cells that carry probability at step t."""
    value = moves.reward + log_z[t + 1, moves.successor]
    value = np.where(moves.allowed(truth), value, -np.inf)
    probabilities = np.exp(value - log_z[t, cells, None])
    return np.asarray(probabilities / np.sum(probabilities, axis=1, keepdims=True))
