"""Moves of a tabular MDP that nothing tells apart, taken together.

Moves of one cell that lead to the same successor and cross the same regions are alike for Z and for
Phi: what counts is the sum of their e^reward. A *way* stands for all of them. There are far fewer
ways than moves where a cell has many start points, and some fewer where it has one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from mlci.spaces import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class Ways:
    """The W ways of all cells, in order of cell, and the regions that they cross.

    Attributes:
        begins: (S+1,) those of cell s are begins[s] to begins[s+1].
        successor: (W,) cell that a way leads to.
        move: (W,) one of its moves, which crosses what the others cross.
        log_weight: (W,) log of the sum of e^reward over its moves [nat]; -inf if it is forbidden.
        crossing_begins: (S+1,) where each cell's crossings begin, of those that are not certain.
        crossing_way: (E,) way of each.
        crossing_region: (E,) region of each.
        certain_begins: (S+1,) likewise of regions that all ways of a cell cross, as where the cell
            lies inside.
        certain_region: (F,) these regions.
    """

    begins: Ints
    successor: Ints
    move: Ints
    log_weight: Floats
    crossing_begins: Ints
    crossing_way: Ints
    crossing_region: Ints
    certain_begins: Ints
    certain_region: Ints

    def without(self, crossed: Bools) -> Ways:
        """These ways, but for those whose moves are `crossed` (S, M)."""
        cell = np.repeat(np.arange(len(crossed)), np.diff(self.begins))
        weight = np.where(crossed[cell, self.move], -np.inf, self.log_weight)
        return replace(self, log_weight=weight)


def merge_moves(
    successor: Ints,
    reward: Floats,
    allowed: Bools,
    crosses: sparse.csr_matrix,
    blocks: Iterator[slice],
) -> Ways:
    """Take together the allowed moves of each cell that nothing tells apart.

    Args:
        successor, reward, allowed: (S, M) as of a TabularMDP.
        crosses: (S * M, C) which regions a move crosses.
        blocks: of cells, in order, whose moves are held at once.
    """
    (states, moves), regions = successor.shape, crosses.shape[1]
    counts = np.zeros((3, states + 1), dtype=np.int64)  # of ways, crossings, certain regions
    parts: list[tuple[Ints | Floats, ...]] = []
    first_way = 0
    for block in blocks:
        ends = crosses.indptr[block.start * moves : block.stop * moves + 1]
        entries = crosses.indices[ends[0] : ends[-1]]
        ends = ends - ends[0]
        order, begins = _groups(successor[block], allowed[block], entries, ends)
        flat = (order + np.arange(len(order))[:, None] * moves).ravel()  # row of `crosses`
        first = np.flatnonzero(begins)
        cell, move = np.divmod(flat[first], moves)
        weights = np.where(allowed[block], reward[block], -np.inf).ravel()[flat]
        # A crossing is that of a way's first move.
        number = ends[flat[first] + 1] - ends[flat[first]]
        way = np.repeat(np.arange(len(first)), number)
        place = np.arange(len(way)) + np.repeat(
            ends[flat[first]] - np.cumsum(number) + number, number
        )
        region = entries[place]
        pair, which, times = np.unique(
            cell[way] * regions + region, return_inverse=True, return_counts=True
        )
        of_cell = np.bincount(cell, minlength=len(order))
        certain = times == of_cell[pair // regions]
        open_ = ~certain[which]
        after = slice(block.start + 1, block.stop + 1)
        counts[0, after] = of_cell
        counts[1, after] = np.bincount(cell[way[open_]], minlength=len(order))
        counts[2, after] = np.bincount(pair[certain] // regions, minlength=len(order))
        parts.append(
            (
                successor[block].ravel()[flat[first]].astype(np.int32),
                move.astype(np.min_scalar_type(moves)),
                _log_sums(weights, first),
                first_way + way[open_],
                region[open_].astype(np.int32),
                (pair[certain] % regions).astype(np.int32),
            )
        )
        first_way += len(first)
    begins_of = np.cumsum(counts, axis=1)
    leads, move_of, weight, way_of, region_of, certain_of = map(
        np.concatenate, zip(*parts, strict=True)
    )
    return Ways(
        begins_of[0],
        leads,
        move_of,
        weight,
        begins_of[1],
        way_of,
        region_of,
        begins_of[2],
        certain_of,
    )


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
