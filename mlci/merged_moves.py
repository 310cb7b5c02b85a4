"""Moves of a cell with the same successor and crossings, merged.

For Z and Phi only the sum of their e^reward counts, so one *merged move* stands for all of them.
There are far fewer merged moves than moves where a cell has many start points, and somewhat fewer
where it has one.
"""

from __future__ import annotations

from collections.abc import Iterable
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
    parts = []
    for block in blocks:
        crosses = block.crosses
        crosses.sort_indices()
        begins, region = crosses.indptr.astype(np.int64), crosses.indices.astype(np.int32)
        cells, first, log_weight = _merge(block.successor, block.reward, begins, region)
        chosen = crosses[first]
        parts.append(
            {
                "begins": np.diff(cells),
                "successor": block.successor.ravel()[first],
                "log_weight": log_weight,
                "crossing_begins": np.diff(chosen.indptr),
                "crossing_region": chosen.indices.astype(np.int32),
            }
        )
    arrays: dict[str, Any] = {}
    for name in list(parts[0]):  # each set of parts goes before the next is joined
        arrays[name] = np.concatenate([part.pop(name) for part in parts])
        if name.endswith("begins"):
            arrays[name] = np.append(0, np.cumsum(arrays[name], dtype=np.int64))
    return MergedMoves(**arrays)


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


@compiled("Tuple((i8[::1], i8[::1], f8[::1]))(i4[:, ::1], f8[:, ::1], i8[::1], i4[::1])")
def _merge(successor, reward, begins, region):  # type: ignore[no-untyped-def]
    """The merged moves of Q cells: where each cell's begin (Q+1,), and of each the number of its
    first move, q M + move, and the log of the sum of e^reward over its moves.

    Args:
        successor, reward: (Q, M).
        begins, region: what move q M + move crosses, as of `_alike`.
    """
    cells, moves = successor.shape
    ends = np.zeros(cells + 1, np.int64)
    first = np.empty(cells * moves, np.int64)
    best, total = np.empty(cells * moves), np.zeros(cells * moves)
    merged = np.empty(moves, np.int64)  # merged move that each move of a cell belongs to
    size = 1
    while size < 2 * moves:
        size *= 2
    table = np.full(size, -1)  # merged moves of a cell, by a hash of successor and regions
    count = 0
    for cell in range(cells):
        for move in range(moves):
            number = cell * moves + move
            if successor[cell, move] < 0:
                continue
            place = np.int64(successor[cell, move]) * 40503
            for i in range(begins[number], begins[number + 1]):
                place = (place ^ region[i]) * 16777619
            place = (place ^ (place >> 15)) & (size - 1)
            while table[place] >= 0:
                other = first[table[place]]
                if successor[cell, move] == successor[cell, other - cell * moves] and _alike(
                    begins, region, number, other
                ):
                    break
                place = (place + 1) & (size - 1)
            if table[place] < 0:
                table[place], first[count], best[count] = count, number, -np.inf
                count += 1
            merged[move] = table[place]
            best[merged[move]] = max(best[merged[move]], reward[cell, move])
        for move in range(moves):
            if successor[cell, move] >= 0:
                total[merged[move]] += np.exp(reward[cell, move] - best[merged[move]])
        if ends[cell] < count:
            table[:] = -1
        ends[cell + 1] = count
    return ends, first[:count].copy(), best[:count] + np.log(total[:count])
