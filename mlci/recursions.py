"""The recursions of the maximum entropy distribution, over arrays indexed by step and cell.

log_z[t, s] is the log of the sum of e^(reward to go) over all ways to get from cell s at step t
into a goal cell at step T, and -inf where there is none or where s cannot be occupied.
alpha_t(s, i) is the probability of avoiding region i from there on; its rows are the cells with
finite log_z[t].
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from mlci.end_moves import EndMoves
from mlci.merged_moves import MergedMoves
from mlci.spaces import Floats, Ints
from mlci.tabular import TabularModel

_CELLS_AT_ONCE = 1 << 12  # whose moves a step of work holds


def reachable_cells(merged: MergedMoves, starts: Ints, steps: int) -> list[Ints]:
    """Cells that can be occupied after t = 0 .. steps allowed moves from some of the starts."""
    cells = [starts]
    for _ in range(steps):
        move, _ = _ranges(merged.begins, cells[-1])
        mark = np.zeros(merged.states, dtype=bool)
        mark[merged.successor[move[merged.log_weight[move] > -np.inf]]] = True
        cells.append(np.flatnonzero(mark))
    return cells


def soft_bellman_backup(merged: MergedMoves, log_z: Floats, cells: dict[int, Ints]) -> None:
    """Fill in log_z (T+1, S), backwards over the cells that can be occupied at each step."""
    for t in sorted(cells, reverse=True):
        for here in _parts(merged, cells[t]):
            move, ends = _ranges(merged.begins, here)
            value = merged.log_weight[move] + log_z[t + 1, merged.successor[move]]
            best = np.maximum.reduceat(value, ends[:-1])
            finite = best > -np.inf
            shift = np.repeat(np.where(finite, best, 0.0), np.diff(ends))
            total = np.add.reduceat(np.exp(value - shift), ends[:-1])
            log_z[t, here[finite]] = best[finite] + np.log(total[finite])


def add_moves(log_z: Floats, t: int, moves: EndMoves) -> None:
    """Fill in log_z[t] of the cells in which some moves begin."""
    np.logaddexp.at(log_z[t], moves.cell, moves.reward + log_z[t + 1, moves.successor])


def avoidance_of_moves(
    log_z: Floats, t: int, moves: EndMoves, alpha_after: Floats, first: int
) -> Floats:
    """alpha_t (Q, C') of the cells with probability at step t, from moves at an end."""
    cells, after = (np.flatnonzero(log_z[step] > -np.inf) for step in (t, t + 1))
    value = moves.reward + log_z[t + 1, moves.successor]
    counts = value > -np.inf  # moves into cells from which no goal can be reached do not
    row, row_after = (
        np.searchsorted(where, of[counts])
        for where, of in ((cells, moves.cell), (after, moves.successor))
    )
    probability = np.exp(value[counts] - log_z[t, moves.cell[counts]])
    avoids = ~moves.crosses[counts, first : first + alpha_after.shape[1]]
    alpha = np.zeros((len(cells), alpha_after.shape[1]))
    np.add.at(alpha, row, probability[:, None] * avoids * alpha_after[row_after])
    return alpha


def avoidance_backwards(
    merged: MergedMoves, log_z: Floats, alpha: Floats, late: int, early: int, first: int
) -> Floats:
    """alpha (Q, C') at step `early` of the regions from `first` on, from that at step `late`."""
    row_of = np.zeros(merged.states, dtype=np.int64)
    cells_after = np.flatnonzero(log_z[late] > -np.inf)
    for t in reversed(range(early, late)):
        row_of[:] = -1
        row_of[cells_after] = np.arange(len(cells_after))
        cells = np.flatnonzero(log_z[t] > -np.inf)
        alpha_after, alpha = alpha, np.empty((len(cells), alpha.shape[1]))
        row = 0
        for here in _parts(merged, cells):
            now = alpha[row : row + len(here)]
            now[:] = _alpha_one_step_back(merged, log_z, t, here, row_of, alpha_after, first)
            row += len(here)
        cells_after = cells
    return alpha


def _alpha_one_step_back(
    merged: MergedMoves,
    log_z: Floats,
    t: int,
    cells: Ints,
    row_of: Ints,
    alpha_after: Floats,
    first: int,
) -> Floats:
    """alpha_t (Q, C') of some cells, from alpha_(t+1) (Q', C'), whose rows `row_of` (S,) gives.

    First the sum over all moves, as a product. Then, for the cells and regions that some move
    crosses: less what those moves bring where that is up to a half, which costs no digit; elsewhere
    the sum over the others anew.
    """
    width = alpha_after.shape[1]
    last = first + width
    move, ends = _ranges(merged.begins, cells)
    value = merged.log_weight[move] + log_z[t + 1, merged.successor[move]]
    probability = np.exp(value - np.repeat(log_z[t, cells], np.diff(ends)))
    probability /= np.repeat(np.add.reduceat(probability, ends[:-1]), np.diff(ends))
    # A successor outside the support has probability 0: whichever row stands for it.
    column = np.maximum(row_of[merged.successor[move]], 0)
    shape = len(cells), len(alpha_after)
    alpha = sparse.csr_matrix((probability, column, ends), shape=shape) @ alpha_after
    owner, entry, region = _of_cells(
        merged.crossing_begins, merged.crossing_region, cells, first, last
    )
    place = merged.crossing_move[entry] - merged.begins[cells[owner]]
    crossing = ends[owner] + place
    lost = np.bincount(
        owner * width + region,
        probability[crossing] * alpha_after[column[crossing], region],
        minlength=alpha.size,
    ).reshape(alpha.shape)
    anew = lost > alpha / 2
    alpha -= lost
    again = anew[owner, region]
    if again.any():
        owner, region, place = owner[again], region[again], place[again]
        pair, which = np.unique(owner * width + region, return_inverse=True)
        cell_of, region_of = np.divmod(pair, width)
        # All moves of the cell of each pair, one pair after the other, without those that cross.
        every, begins = _ranges(ends, cell_of)
        weight = probability[every]
        weight[begins[which] + place] = 0.0
        weight *= alpha_after[column[every], np.repeat(region_of, np.diff(begins))]
        alpha[cell_of, region_of] = np.add.reduceat(weight, begins[:-1])
    owner, _, region = _of_cells(merged.certain_begins, merged.certain_region, cells, first, last)
    alpha[owner, region] = 0.0
    return alpha


def _of_cells(
    begins: Ints, regions: Ints, cells: Ints, first: int, last: int
) -> tuple[Ints, Ints, Ints]:
    """Entries of some cells whose regions are from `first` to before `last`.

    Returns the place in `cells` that each belongs to, its own number, and its region less `first`.
    """
    entry, ends = _ranges(begins, cells)
    owner = np.repeat(np.arange(len(cells)), np.diff(ends))
    region = regions[entry] - first
    inside = (region >= 0) & (region < last - first)
    if inside.all():
        return owner, entry, region
    return owner[inside], entry[inside], region[inside]


def _parts(merged: MergedMoves, cells: Ints) -> Iterator[Ints]:
    """Cells that some move leaves, in parts whose moves fit into memory and cache."""
    begins = merged.begins
    left = cells[begins[cells + 1] > begins[cells]]
    for first in range(0, len(left), _CELLS_AT_ONCE):
        yield left[first : first + _CELLS_AT_ONCE]


def _ranges(begins: Ints, cells: Ints) -> tuple[Ints, Ints]:
    """The numbers from begins[s] to before begins[s+1] of some cells s, and where each begin."""
    counts = begins[cells + 1] - begins[cells]
    ends = np.append(0, np.cumsum(counts))
    return np.arange(ends[-1]) + np.repeat(begins[cells] - ends[:-1], counts), ends


def move_probabilities(model: TabularModel, log_z: Floats, t: int, cells: Ints) -> Floats:
    """(Q, M) probabilities of the moves of cells that carry probability at step t."""
    value = model.reward[cells] + log_z[t + 1, model.successor[cells]]
    value = np.where(model.allowed[cells], value, -np.inf)
    probabilities = np.exp(value - log_z[t, cells, None])
    return np.asarray(probabilities / np.sum(probabilities, axis=1, keepdims=True))
