"""Regular grids of cells over a state space: MDP states, hypothesis cells and value functions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mlci.spaces import Box, Floats, Ints, StateSpace, middle_and_half


@dataclass(frozen=True, eq=False)
class Grid:
    """Equal cells that cover a state space; cells are numbered in C order of their indices.

    Attributes:
        space: the state space that is covered.
        shape: (n,) number of cells in each dimension.
        offset: (n,) how far the cells are shifted, as a share of a cell in [0, 1); 0 where the
            space is not periodic. The last cell of a shifted dimension goes across the seam.

    Raises:
        ValueError: a shape of the wrong length or with an entry below 1, or an offset out of range.
    """

    space: StateSpace
    shape: tuple[int, ...]
    offset: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        shape = tuple(int(count) for count in self.shape)
        if len(shape) != self.space.dimension or min(shape, default=0) < 1:
            raise ValueError(
                f"a grid over {self.space.names} needs {self.space.dimension} counts of at "
                f"least 1, not {list(self.shape)}"
            )
        offset = tuple(float(share) for share in self.offset) or (0.0,) * len(shape)
        if len(offset) != len(shape) or not all(
            0 <= share < (1 if periodic else 1e-300)
            for share, periodic in zip(offset, self.space.periodic, strict=False)
        ):
            raise ValueError(
                f"a grid over {self.space.names} needs {len(shape)} offsets from 0 to below 1, and "
                f"0 in a dimension that does not wrap, not {list(offset)}"
            )
        object.__setattr__(self, "shape", shape)
        object.__setattr__(self, "offset", offset)

    @property
    def size(self) -> int:
        """S, the number of cells."""
        return int(np.prod(self.shape))

    @cached_property
    def widths(self) -> Floats:
        """(n,) side lengths of a cell."""
        return self.space.bounds.widths / self.shape

    @cached_property
    def _lower(self) -> Floats:
        """(n,) lower corner of the first cell."""
        return self.space.bounds.lower + np.array(self.offset) * self.widths

    @cached_property
    def axes(self) -> tuple[Floats, ...]:
        """Cell centres along each dimension: n arrays of length shape[d]; not wrapped."""
        lower = self._lower
        return tuple(
            lower[d] + (np.arange(count) + 0.5) * self.widths[d]
            for d, count in enumerate(self.shape)
        )

    @cached_property
    def centers(self) -> Floats:
        """(S, n) centre x_s of every cell."""
        return np.stack([axis.ravel() for axis in np.meshgrid(*self.axes, indexing="ij")], axis=-1)

    @cached_property
    def corners(self) -> tuple[Floats, Floats]:
        """Lower and upper corner (S, n) of every cell; neighbours share theirs to the last bit."""
        lower, place = self._lower, np.indices(self.shape).reshape(len(self.shape), -1).T
        return lower + place * self.widths, lower + (place + 1) * self.widths

    def index(self, states: ArrayLike) -> Ints:
        """Number (...,) of the cell that holds each of states (..., n), or -1 outside and for NaN.

        Cells are half open; the upper bound of the space belongs to the last cell.
        """
        wrapped = self.space.wrap(states)
        inside = self.space.contains(wrapped)
        number = np.zeros(inside.shape, dtype=np.int64)
        for d, count in enumerate(self.shape):
            position = np.floor((wrapped[..., d] - self._lower[d]) / self.widths[d])
            position = np.where(inside, position, 0.0).astype(np.int64)
            # What lies before the first cell of a shifted dimension belongs to the last.
            before = count - 1 if self.space.periodic[d] else 0
            position = np.where(position < 0, before, np.minimum(position, count - 1))
            number = number * count + position
        return np.where(inside, number, -1)

    def points_inside(self, samples: int, cells: slice | Ints = slice(None)) -> Floats:
        """(S, samples^n, n): the centres of a regular subdivision of every cell, or of some."""
        ticks = (np.arange(samples) + 0.5) / samples - 0.5
        offsets = np.stack(np.meshgrid(*[ticks] * len(self.shape), indexing="ij"), axis=-1)
        return self.centers[cells, None, :] + offsets.reshape(-1, len(self.shape)) * self.widths

    def cells_in(self, region: Box) -> Ints:
        """Numbers of the cells that a region meets, sorted; empty if it is outside.

        In a dimension in which the region is a point this is the cell that holds it; otherwise it
        is every cell that the region enters, more than its edge.

        Raises:
            ValueError: a side that is bounded at one end alone.
        """
        centre, half = middle_and_half(region)
        along = []
        for d, axis in enumerate(self.axes):
            if not np.isfinite(half[d]):
                along.append(np.arange(self.shape[d]))
                continue
            middle = self.space.bounds.lower.copy()
            middle[d] = centre[d]
            if half[d] == 0:
                cell = int(self.index(middle))
                if cell < 0:
                    return np.empty(0, dtype=np.int64)
                along.append(np.array([np.unravel_index(cell, self.shape)[d]]))
                continue
            probes = np.tile(middle, (len(axis), 1))
            probes[:, d] = axis
            apart = np.abs(self.space.difference(probes, middle)[:, d])
            reach = (region.widths[d] + self.widths[d]) / 2
            along.append(np.flatnonzero(apart < reach * (1 - 1e-12)))
        mesh = np.meshgrid(*along, indexing="ij")
        return np.sort(np.ravel_multi_index([part.ravel() for part in mesh], self.shape))

    def interpolate(self, values: Floats, states: ArrayLike) -> Floats:
        """Multilinear interpolation of cell-centre values at states.

        Args:
            values: (S, ...) one entry a cell.
            states: (..., n) states; those outside the bounds take the nearest bound's value.

        Returns:
            (..., *values.shape[1:]), linear between centres, extrapolated linearly over the half
            cell between the outermost centres and the bounds.
        """
        corners, fractions = self._surround(values, states)
        tail = (1,) * (values.ndim - 1)
        for fraction in fractions:
            share = np.reshape(fraction, (*fraction.shape, *tail))
            corners = corners[0] + share * (corners[1] - corners[0])
        return corners

    def slope(self, values: Floats, states: ArrayLike) -> Floats:
        """Exact gradient (..., n) of `interpolate` for values (S,); 0 beyond the bounds."""
        corners, fractions = self._surround(values, states)
        slopes = []
        for d in range(len(self.shape)):
            part = corners
            for axis in range(len(self.shape)):
                rise = part[1] - part[0]
                part = rise / self.widths[d] if axis == d else part[0] + fractions[axis] * rise
            slopes.append(part)
        states, bounds = np.asarray(states), self.space.bounds
        within = (states >= bounds.lower) & (states <= bounds.upper) | self.space.periodic
        return np.where(within, np.stack(slopes, axis=-1), 0.0)

    def _surround(self, values: Floats, states: ArrayLike) -> tuple[Floats, list[Floats]]:
        """Values at the centres around states, and the place of the states among them.

        Returns (2, ..., 2, *batch, ...) values, lower and upper centre along each dimension, and
        for each dimension how far (*batch) a state is above the lower centre, in cells.
        """
        states, n = np.asarray(states), len(self.shape)
        node: Ints = np.zeros((), dtype=np.int64)
        fractions = []
        # One dimension after the other: numpy is slow along an axis as short as that of dimensions.
        for d, count in enumerate(self.shape):
            position = (states[..., d] - self._lower[d]) / self.widths[d] - 0.5
            if not self.space.periodic[d]:
                position = np.minimum(np.maximum(position, -0.5), count - 0.5)
            low = np.floor(position)
            if not self.space.periodic[d]:
                low = np.minimum(np.maximum(low, 0.0), max(count - 2.0, 0.0))
            fractions.append(position - low)
            below = low.astype(np.int64)
            if self.space.periodic[d]:
                below %= count
            above = np.where(below + 1 == count, 0, below + 1)
            ends = np.stack([below, above]) * self._strides[d]
            along = (2 if axis == d else 1 for axis in range(n))
            node = node + ends.reshape(*along, *low.shape)
        # A state that is not a number belongs to no cell: any will do, as its fraction is nan.
        return values.take(node, axis=0, mode="clip"), fractions

    @cached_property
    def _strides(self) -> Ints:
        """(n,) how many cells further the next one along a dimension is."""
        return np.append(np.cumprod(self.shape[::-1])[-2::-1], 1).astype(np.int64)
