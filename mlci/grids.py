"""Regular grids of cells over a state space: MDP states, hypothesis cells and value functions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mlci.compiled import compiled
from mlci.spaces import Bools, Box, Floats, Ints, StateSpace, middle_and_half


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

    @cached_property
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
        numbers = np.arange(self.size)[cells] if isinstance(cells, slice) else cells
        places = np.unravel_index(numbers, self.shape)
        centers = [axis[place] for axis, place in zip(self.axes, places, strict=True)]
        around = offsets.reshape(-1, len(self.shape)) * self.widths
        return np.stack(centers, axis=-1)[:, None, :] + around

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
        columns = np.asarray(values, dtype=float).reshape(self.size, -1)
        between = self._between(columns, np.asarray(states), _VALUE)
        return between.reshape((*np.shape(states)[:-1], *values.shape[1:]))

    def slope(self, values: Floats, states: ArrayLike) -> Floats:
        """Exact gradient (..., n) of `interpolate` for values (S,); 0 beyond the bounds."""
        states, bounds = np.asarray(states), self.space.bounds
        columns = np.asarray(values, dtype=float)[:, None]
        slopes = [
            self._between(columns, states, d).reshape(states.shape[:-1]) / width
            for d, width in enumerate(self.widths)
        ]
        within = (states >= bounds.lower) & (states <= bounds.upper) | self.space.periodic
        return np.where(within, np.stack(slopes, axis=-1), 0.0)

    def _between(self, columns: Floats, states: Floats, along: int) -> Floats:
        """`_multilinear` (B, C) of values (S, C) at all of states (..., n)."""
        flat = np.asarray(states, dtype=float).reshape(-1, len(self.shape))
        periodic = self.space.periodic
        return _multilinear(columns, flat, self._lower, self.widths, self._counts, periodic, along)

    @cached_property
    def _counts(self) -> Ints:
        """(n,) number of cells in each dimension."""
        return np.array(self.shape)


_VALUE = -1  # in place of a dimension along which `_multilinear` takes the rise


@compiled("f8[:, ::1](in f8[:, :], in f8[:, :], in f8[::1], in f8[::1], i8[::1], in b1[::1], i8)")
def _multilinear(
    values: Floats,
    states: Floats,
    lower: Floats,
    widths: Floats,
    shape: Ints,
    periodic: Bools,
    along: int,
) -> Floats:
    """Interpolated values, or their rise (B, C) by one cell along a dimension.

    Args:
        values: (S, C) at the cell centres.
        states: (B, n), not wrapped.
        lower: (n,) lower corner of the first cell.
        widths: (n,) of a cell.
        shape: (n,) cells.
        periodic: (n,) which dimensions wrap.
        along: the dimension of the rise, or `_VALUE`.
    """
    n, corners = len(shape), 2 ** len(shape)
    result = np.empty((len(states), values.shape[1]))
    share, cell, part = np.empty(n), np.zeros(corners, np.int64), np.empty(corners)
    for b in range(len(states)):
        # Each dimension doubles the centres around the state; the first becomes the outermost.
        size, stride = 1, 1
        for d in range(n - 1, -1, -1):
            cells = shape[d]
            place = (states[b, d] - lower[d]) / widths[d] - 0.5
            if periodic[d]:
                low = np.floor(place)
            else:
                place = -0.5 if place < -0.5 else place
                place = cells - 0.5 if place > cells - 0.5 else place
                low = np.floor(place)
                low = cells - 2.0 if low > cells - 2.0 else low
                low = 0.0 if low < 0.0 else low
            share[d] = place - low
            if low < 0.0 or low >= cells:
                low %= cells
            # A state that is not a number belongs to no cell: any will do, as its share is nan.
            below = np.int64(low) if np.isfinite(low) else 0
            above = below + 1 if below + 1 < cells else 0
            for i in range(size):
                first = cell[i] if d < n - 1 else 0
                cell[i], cell[size + i] = first + below * stride, first + above * stride
            size, stride = 2 * size, cells * stride
        for c in range(values.shape[1]):
            for i in range(corners):
                part[i] = values[cell[i], c]
            size = corners
            for d in range(n):
                size //= 2
                for i in range(size):
                    rise = part[size + i] - part[i]
                    part[i] = rise if d == along else part[i] + share[d] * rise
            result[b, c] = part[0]
    return result
