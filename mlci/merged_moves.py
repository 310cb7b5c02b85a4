"""Moves of a cell with the same successor and crossings, merged.

For Z and Phi only the sum of their e^reward counts, so one *merged move* stands for all of them.
There are far fewer merged moves than moves where a cell has many start points, and somewhat fewer
where it has one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from mlci.spaces import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class MergedMoves:
    """The W merged moves of all cells, in order of cell, and the regions that they cross.

    Attributes:
        begins: (S+1,) those of cell s are begins[s] to begins[s+1].
        successor: (W,) cell that a merged move leads to.
        move: (W,) one of its moves, which crosses what the others cross.
        log_weight: (W,) log of the sum of e^reward over its moves [nat]; -inf if it is forbidden.
        crossing_begins: (W+1,) the regions that merged move k crosses are crossing_region[i] for i
            from crossing_begins[k] to crossing_begins[k+1].
        crossing_region: (E,) these regions.
    """

    begins: Ints
    successor: Ints
    move: Ints
    log_weight: Floats
    crossing_begins: Ints
    crossing_region: Ints

    @property
    def states(self) -> int:
        """S, the number of cells."""
        return len(self.begins) - 1

    def scaled(self, factor: float) -> MergedMoves:
        """The same with rewards times a factor, as at another temperature; no two are merged."""
        return replace(self, log_weight=self.log_weight * factor)

    def crosses(self, moves: Ints, regions: int) -> Bools:
        """(L, C) which of the C regions some merged moves (L,) cross."""
        crossed = np.zeros((len(moves), regions), dtype=bool)
        for row, begin, end in zip(
            crossed, self.crossing_begins[moves], self.crossing_begins[moves + 1], strict=True
        ):
            row[self.crossing_region[begin:end]] = True
        return crossed

    def without(self, crossed: Bools) -> MergedMoves:
        """The same with those forbidden whose moves are `crossed` (S, M)."""
        cell = np.repeat(np.arange(len(crossed)), np.diff(self.begins))
        weight = np.where(crossed[cell, self.move], -np.inf, self.log_weight)
        return replace(self, log_weight=weight)


def merge_moves(
    successor: Ints,
    reward: Floats,
    allowed: Bools,
    crosses: sparse.csr_matrix,
    blocks: Iterable[slice],
) -> MergedMoves:
    """Merge the allowed moves of each cell that have one successor and cross the same regions.

    Args:
        successor, reward, allowed: (S, M) as of a TabularModel.
        crosses: (S * M, C) which regions a move crosses.
        blocks: of cells, in order, whose moves are held at once.
    """
    moves = successor.shape[1]
    parts = []
    for block in blocks:
        ends = crosses.indptr[block.start * moves : block.stop * moves + 1]
        entries = crosses.indices[ends[0] : ends[-1]]
        parts.append(
            _merge_block(successor[block], reward[block], allowed[block], entries, ends - ends[0])
        )
    return _concatenated(parts)


def _merge_block(
    successor: Ints, reward: Floats, allowed: Bools, entries: Ints, ends: Ints
) -> MergedMoves:
    """The merged moves of some cells (Q, M); move k of them crosses entries[ends[k]:ends[k+1]]."""
    cells, moves = successor.shape
    order, begins = _groups(successor, allowed, entries, ends)
    row = (order + np.arange(cells)[:, None] * moves).ravel()  # numbers of the moves, in order
    first = np.flatnonzero(begins)  # of each merged move, the place of its first move in that order
    cell, move = np.divmod(row[first], moves)
    # What the first move crosses, all of a merged move cross.
    count = ends[row[first] + 1] - ends[row[first]]
    entry = np.arange(np.sum(count)) + np.repeat(ends[row[first]] - np.cumsum(count) + count, count)
    return MergedMoves(
        begins=_begins(np.bincount(cell, minlength=cells)),
        successor=successor.ravel()[row[first]].astype(np.int32),
        move=move.astype(np.min_scalar_type(moves)),
        log_weight=_log_sums(np.where(allowed, reward, -np.inf).ravel()[row], first),
        crossing_begins=_begins(count),
        crossing_region=entries[entry].astype(np.int32),
    )


def _concatenated(parts: Sequence[MergedMoves]) -> MergedMoves:
    """The merged moves of consecutive blocks of cells as those of all."""

    def joined(name: str) -> Any:
        return np.concatenate([getattr(part, name) for part in parts])

    def begins(name: str) -> Ints:
        return _begins(np.concatenate([np.diff(getattr(part, name)) for part in parts]))

    return MergedMoves(
        begins=begins("begins"),
        successor=joined("successor"),
        move=joined("move"),
        log_weight=joined("log_weight"),
        crossing_begins=begins("crossing_begins"),
        crossing_region=joined("crossing_region"),
    )


def _begins(counts: Ints) -> Ints:
    """(Q+1,) where each of Q runs begins in an array of all, and where the last one ends."""
    return np.append(0, np.cumsum(counts)).astype(np.int64)


def _groups(successor: Ints, allowed: Bools, entries: Ints, ends: Ints) -> tuple[Ints, Bools]:
    """An order (S, M) of each cell's moves in which those alike are neighbours, and where each
    group begins; what is not allowed comes last and belongs to no group.

    Moves are compared by 64 bits of their successor and regions. That two which differ agree in all
    bits has a chance below 1e-11 for any cell of a grid of a million with 15 moves each.
    """
    summed = np.append(np.uint64(0), np.cumsum(_scrambled(entries, 1), dtype=np.uint64))
    sign = (summed[ends[1:]] - summed[ends[:-1]]).reshape(successor.shape)
    sign = (sign + _scrambled(successor, 2)) >> np.uint64(1)
    sign = np.where(allowed, sign, np.iinfo(np.uint64).max)
    order = np.argsort(sign, axis=1, kind="stable")
    ordered = np.take_along_axis(sign, order, axis=1)
    begins = np.ones(order.shape, dtype=bool)
    begins[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
    return order, begins & np.take_along_axis(allowed, order, axis=1)


def _scrambled(numbers: Ints, stream: int) -> np.ndarray:
    """64 well mixed bits of each number (the finaliser of SplitMix64)."""
    bits = (numbers.astype(np.uint64) + np.uint64(stream << 32)) * np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))


def _log_sums(values: Floats, first: Ints) -> Floats:
    """log of the sum of e^value over each group, which begins at `first` and ends at the next.

    The first value of a group is finite.
    """
    if not len(first):
        return np.empty(0)
    best = np.maximum.reduceat(values, first)
    owner = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(values))))
    shifted = np.exp(values[first[0] :] - best[owner])
    return np.asarray(best + np.log(np.add.reduceat(shifted, first - first[0])))
