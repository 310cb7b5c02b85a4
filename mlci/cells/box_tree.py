"""Boxes of varying size over a state space, from splitting boxes in two.

The nodes of the tree stand in preorder: after a node that is split comes all that is below the
split, then all that is above it. So two arrays are the whole tree, and its leaves, the cells, are
numbered in that order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mlci.spaces import Bools, Box, Floats, Ints, StateSpace, middle_and_half

LEAF = -1  # in place of a dimension
_SAME = 1e-12  # of a width: what meets at an edge alone


@dataclass(frozen=True, eq=False)
class BoxTree:
    """Cells of varying size; takes the place of `mlci.grids.Grid` in a `TabularModel`.

    Attributes:
        space: the state space that is covered.
        dimension: (N,) along which each node is split, in preorder; `LEAF` for a cell.
        position: (N,) where it is split; any number for a cell.

    Raises:
        ValueError: arrays that are no tree over the space.
    """

    space: StateSpace
    dimension: Ints
    position: Floats

    def __post_init__(self) -> None:
        dimension = np.atleast_1d(np.array(self.dimension, dtype=np.int64))
        position = np.atleast_1d(np.array(self.position, dtype=float))
        if dimension.shape != position.shape or dimension.ndim != 1:
            raise ValueError(
                f"a tree needs a dimension and a position for each node, not {dimension.shape} and "
                f"{position.shape}"
            )
        if np.any((dimension < LEAF) | (dimension >= self.space.dimension)):
            raise ValueError(
                f"a tree over {self.space.names} is split along 0 to {self.space.dimension - 1}, "
                f"or {LEAF} for a cell, not {dimension.tolist()}"
            )
        # Of a tree in preorder every part from the start has more splits than leaves but the whole.
        open_ends = 1 + np.cumsum(np.where(dimension == LEAF, -1, 1))
        if not len(dimension) or open_ends[-1] != 0 or np.any(open_ends[:-1] < 1):
            raise ValueError("these nodes are no tree in preorder: each split has two parts")
        object.__setattr__(self, "dimension", dimension)
        object.__setattr__(self, "position", position)
        lower, upper = self._bounds
        node = np.flatnonzero(dimension != LEAF)
        place = position[node], dimension[node]
        inside = (lower[node, place[1]] < place[0]) & (place[0] < upper[node, place[1]])
        if not np.all(inside):
            raise ValueError(f"node {node[np.argmin(inside)]} is split outside of its box")

    def halved(self, along: Ints) -> BoxTree:
        """The tree whose cells are halved along dimensions (S,), or left where that is `LEAF`.

        The cells that were before a cell are before its parts.
        """
        along = np.asarray(along, dtype=np.int64)
        split, leaf = along != LEAF, self._leaves
        repeats = np.ones(len(self.dimension), dtype=np.int64)
        repeats[leaf[split]] = 3  # the node, which is split now, and two cells
        dimension, position = np.repeat(self.dimension, repeats), np.repeat(self.position, repeats)
        node = (np.cumsum(repeats) - repeats)[leaf[split]]
        dimension[node] = along[split]
        position[node] = self.centers[split, along[split]]
        return BoxTree(self.space, dimension, position)

    @cached_property
    def size(self) -> int:
        """S, the number of cells."""
        return len(self._leaves)

    @cached_property
    def _leaves(self) -> Ints:
        """(S,) nodes that are cells."""
        return np.flatnonzero(self.dimension == LEAF)

    @cached_property
    def _above(self) -> Ints:
        """(N,) the part of each node above its split; the part below is the next node."""
        above, waiting = np.zeros(len(self.dimension), dtype=np.int64), []
        for node, d in enumerate(self.dimension.tolist()):
            if d != LEAF:
                waiting.append(node)
            elif waiting:
                above[waiting.pop()] = node + 1
        return above

    @cached_property
    def _cell(self) -> Ints:
        """(N,) number of the cell that a node is, of any of its own for one that is split."""
        return np.cumsum(self.dimension == LEAF) - 1

    @cached_property
    def _bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corner (N, n) of every node."""
        shape = len(self.dimension), self.space.dimension
        lower = np.broadcast_to(self.space.bounds.lower, shape).copy()
        upper = np.broadcast_to(self.space.bounds.upper, shape).copy()
        level = np.zeros(1, dtype=np.int64)
        while len(level := level[self.dimension[level] != LEAF]):
            below, above, d = level + 1, self._above[level], self.dimension[level]
            for part in (below, above):
                lower[part], upper[part] = lower[level], upper[level]
            upper[below, d] = lower[above, d] = self.position[level]
            level = np.concatenate([below, above])
        return lower, upper

    @cached_property
    def corners(self) -> tuple[Floats, Floats]:
        """Lower and upper corner (S, n) of every cell; neighbours share theirs to the last bit."""
        lower, upper = self._bounds
        return lower[self._leaves], upper[self._leaves]

    @cached_property
    def centers(self) -> Floats:
        """(S, n) centre of every cell."""
        lower, upper = self.corners
        return np.asarray((lower + upper) / 2)

    @cached_property
    def sides(self) -> Floats:
        """(S, n) side lengths of every cell."""
        lower, upper = self.corners
        return upper - lower

    @cached_property
    def widths(self) -> Floats:
        """(n,) side length of a cell along each dimension, the geometric mean: a cell that is thin
        only because two goals nearly meet there says nothing of the others."""
        return np.asarray(np.exp(np.mean(np.log(self.sides), axis=0)))

    def index(self, states: ArrayLike) -> Ints:
        """Number (...,) of the cell that holds each of states (..., n), or -1 outside and for NaN.

        Cells are half open; the upper bound of the space belongs to the last cell.
        """
        wrapped = self.space.wrap(states)
        inside = self.space.contains(wrapped)
        flat = wrapped.reshape(-1, self.space.dimension)
        node, left = np.zeros(len(flat), dtype=np.int64), np.flatnonzero(inside.ravel())
        while len(left := left[self.dimension[node[left]] != LEAF]):
            here = node[left]
            below = flat[left, self.dimension[here]] < self.position[here]
            node[left] = np.where(below, here + 1, self._above[here])
        return np.where(inside, self._cell[node].reshape(inside.shape), -1)

    def points_inside(self, samples: int, cells: Ints) -> Floats:
        """(Q, samples^n, n): the centres of a regular subdivision of some cells (Q,)."""
        ticks = (np.arange(samples) + 0.5) / samples - 0.5
        n = self.space.dimension
        offsets = np.stack(np.meshgrid(*[ticks] * n, indexing="ij"), axis=-1).reshape(-1, n)
        return self.centers[cells, None, :] + offsets * self.sides[cells, None, :]

    def cells_in(self, region: Box) -> Ints:
        """Numbers of the cells that a region meets, sorted; empty if it is outside.

        In a dimension in which the region is a point these are the cells that hold it; otherwise
        those that the region enters, more than their edge.

        Raises:
            ValueError: a side that is bounded at one end alone.
        """
        middle, half = middle_and_half(region)
        met: Bools = np.ones(self.size, dtype=bool)
        lower, upper = self.corners
        bounds, space = self.space.bounds, self.space
        at = space.wrap(middle)
        for d in np.flatnonzero(np.isfinite(half)).tolist():
            if half[d] == 0:
                last = (at[d] == bounds.upper[d]) & (upper[:, d] == bounds.upper[d])
                met &= (lower[:, d] <= at[d]) & (at[d] < upper[:, d]) | last
                continue
            apart = np.abs(space.difference(self.centers, middle)[:, d])
            met &= apart < (half[d] + self.sides[:, d] / 2) * (1 - _SAME)
        return np.flatnonzero(met)
