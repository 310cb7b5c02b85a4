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

from mlci.compiled import compiled
from mlci.single_moves import SingleMoves
from mlci.spaces import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class MergedMoves:
    """The W merged moves of all cells, in order of cell, and the regions that they cross.

    Attributes:
        begins: (S+1,) those of cell s are begins[s] to begins[s+1].
        successor: (W,) cell that a merged move leads to.
        log_weight: (W,) log of the sum of e^reward over its moves [nat]; -inf if it is forbidden.
        crossing_begins: (W+1,) the regions that merged move k crosses are crossing_region[i] for i
            from crossing_begins[k] to crossing_begins[k+1].
        crossing_region: (E,) these regions.
    """

    begins: Ints
    successor: Ints
    log_weight: Floats
    crossing_begins: Ints
    crossing_region: Ints

    @property
    def states(self) -> int:
        """S, the number of cells."""
        return len(self.begins) - 1

    @property
    def allowed_successors(self) -> Ints:
        """Cells that those lead to which are not forbidden."""
        return self.successor[self.log_weight > -np.inf]

    def scaled(self, factor: float) -> MergedMoves:
        """The same with rewards times a factor, as at another temperature; no two are merged."""
        return replace(self, log_weight=self.log_weight * factor)

    def placed(self, cells: Ints, states: int) -> MergedMoves:
        """The moves of Q cells as those of cells (Q,) among S, the others of which have none."""
        count, order = np.zeros(states, dtype=np.int64), np.argsort(cells)
        count[cells] = np.diff(self.begins)
        move = _entries(self.begins, order)
        return MergedMoves(
            run_begins(count),
            self.successor[move],
            self.log_weight[move],
            run_begins(np.diff(self.crossing_begins)[move]),
            self.crossing_region[_entries(self.crossing_begins, move)],
        )

    def crosses(self, moves: Ints, regions: int) -> Bools:
        """(L, C) which of the C regions some merged moves (L,) cross."""
        crossed = np.zeros((len(moves), regions), dtype=bool)
        for row, begin, end in zip(
            crossed, self.crossing_begins[moves], self.crossing_begins[moves + 1], strict=True
        ):
            row[self.crossing_region[begin:end]] = True
        return crossed

    def under(self, truth: Bools) -> MergedMoves:
        """The same with those forbidden that cross the truth, a mask (C,) of regions."""
        entry = np.flatnonzero(truth[self.crossing_region])
        weight = self.log_weight.copy()
        weight[np.searchsorted(self.crossing_begins, entry, side="right") - 1] = -np.inf
        return replace(self, log_weight=weight)

    def cells_into(self, cells: Ints) -> Ints:
        """Cells of which some move leads into one of some cells, forbidden or not; sorted."""
        move = np.flatnonzero(np.isin(self.successor, cells))
        return np.unique(np.searchsorted(self.begins, move, side="right") - 1)


def merge_moves(blocks: Iterable[SingleMoves]) -> MergedMoves:
    """Merge the moves of each cell that have one successor and cross the same regions.

    Args:
        blocks: the moves of consecutive cells; one block is held at a time.
    """
    return joined([_merged(block) for block in blocks])


def joined(parts: Sequence[MergedMoves]) -> MergedMoves:
    """The merged moves of the cells of all parts, in order."""

    def all_of(name: str) -> Any:
        return np.concatenate([getattr(part, name) for part in parts])

    def counts(name: str) -> Ints:
        return np.concatenate([np.diff(getattr(part, name)) for part in parts])

    return MergedMoves(
        run_begins(counts("begins")),
        all_of("successor"),
        all_of("log_weight"),
        run_begins(counts("crossing_begins")),
        all_of("crossing_region"),
    )


def run_begins(counts: Ints) -> Ints:
    """(Q+1,) where each of Q runs begins in an array of all, and where the last one ends."""
    return np.append(0, np.cumsum(counts, dtype=np.int64))


def _entries(begins: Ints, runs: Ints) -> Ints:
    """The places of all entries of some runs, one after the other."""
    count = np.diff(begins)[runs]
    first = begins[runs] - run_begins(count)[:-1]
    return np.arange(np.sum(count)) + np.repeat(first, count)


def _merged(block: SingleMoves) -> MergedMoves:
    """The merged moves of the cells of a block."""
    crosses = block.crosses
    if not crosses.has_sorted_indices:
        crosses = crosses.sorted_indices()
    begins, region = crosses.indptr.astype(np.int64), crosses.indices.astype(np.int32)
    cells, moves = block.successor.shape
    ends, first = np.zeros(cells + 1, dtype=np.int64), np.empty(cells * moves, dtype=np.int64)
    log_weight, total = np.full(cells * moves, -np.inf), np.zeros(cells * moves)
    table = np.full(1 << (2 * moves - 1).bit_length(), -1)
    room = total, table, np.empty(moves, dtype=np.int64)
    _merge(block.successor, block.reward, begins, region, room, ends, first, log_weight)
    first = first[: ends[-1]]
    return MergedMoves(
        ends,
        block.successor.ravel()[first],
        log_weight[: ends[-1]].copy(),
        run_begins(np.diff(begins)[first]),
        region[_entries(begins, first)],
    )


@compiled("b1(i8[::1], i4[::1], i8, i8)")
def _alike(begins: Ints, region: Ints, one: int, other: int) -> bool:
    """Whether two moves cross the same regions: region[begins[k]:begins[k + 1]] of each, sorted."""
    count = begins[one + 1] - begins[one]
    if count != begins[other + 1] - begins[other]:
        return False
    same = True
    for i in range(count):
        same &= region[begins[one] + i] == region[begins[other] + i]
    return same


@compiled(
    "void(in i4[:, ::1], in f8[:, ::1], i8[::1], i4[::1], Tuple((f8[::1], i8[::1], i8[::1])), "
    "i8[::1], i8[::1], f8[::1])"
)
def _merge(  # type: ignore[no-untyped-def]
    successor, reward, begins, region, room, ends, first, log_weight
):
    """The merged moves of Q cells: where each cell's end, and of each the number of its first move,
    q M + move, and the log of the sum of e^reward over its moves.

    Args:
        successor, reward: (Q, M).
        begins, region: what move q M + move crosses, as of `_alike`.
        room: zeros (Q M,) for sums; -1s, 2M or more and a power of 2; and anything (M,).
        ends: (Q+1,), from 0 on; of this and the next two the entries that count are filled in.
        first: (Q M,).
        log_weight: (Q M,), -inf before.
    """
    # The table is of merged moves of a cell, by a hash of successor and regions; `merged` has the
    # merged move that each move of a cell belongs to.
    total, table, merged = room
    cells, moves = successor.shape
    count = 0
    for cell in range(cells):
        for move in range(moves):
            number = cell * moves + move
            if successor[cell, move] < 0:
                continue
            place = np.int64(successor[cell, move]) * 40503
            for i in range(begins[number], begins[number + 1]):
                place = (place ^ region[i]) * 16777619
            place = (place ^ (place >> 15)) & (len(table) - 1)
            while table[place] >= 0:
                other = first[table[place]]
                if successor[cell, move] == successor[cell, other - cell * moves] and _alike(
                    begins, region, number, other
                ):
                    break
                place = (place + 1) & (len(table) - 1)
            if table[place] < 0:
                table[place], first[count] = count, number
                count += 1
            merged[move] = table[place]
            best = log_weight[merged[move]]
            log_weight[merged[move]] = max(best, reward[cell, move])
        for move in range(moves):
            if successor[cell, move] >= 0:
                total[merged[move]] += np.exp(reward[cell, move] - log_weight[merged[move]])
        if ends[cell] < count:
            for slot in range(len(table)):
                table[slot] = -1
        ends[cell + 1] = count
    for k in range(count):
        log_weight[k] += np.log(total[k])
