"""One time step of the Hamilton-Jacobi equation (9) on a grid, upwind, as compiled loops.

Each dimension's derivative is taken from the side that the flow comes to, for each extremal
control, and the largest sum over the controls is clipped at zero. For dynamics that are affine in
the control the maximum over the box is one over its vertices.

Cells are (rows, m): rows along the last dimension, in which the loops run over memory in its order.
"""

from __future__ import annotations

import numpy as np

from mlci.compiled import compiled
from mlci.grids import Grid
from mlci.spaces import Floats, Ints


def neighbour_rows(grid: Grid) -> Ints:
    """(n - 1, rows, 4) the rows two and one before and one and two after each, by dimension.

    Beyond a side that is not periodic it is the row at the side. A row of cells is along the last
    dimension.
    """
    shape = grid.shape[:-1]
    rows = np.arange(grid.size // grid.shape[-1]).reshape(shape)
    beside = np.empty((len(shape), rows.size, 4), dtype=np.int64)
    for d, count in enumerate(shape):
        for k, ahead in enumerate((-2, -1, 1, 2)):
            place = np.arange(count) + ahead
            wraps = grid.space.periodic[d]
            place = place % count if wraps else np.clip(place, 0, count - 1)
            beside[d, :, k] = np.take(rows, place, axis=d).ravel()
    return beside


@compiled("void(in f8[::1], in f8[::1], in f8[::1], in f8[::1], in f8[::1], f8[::1], f8[::1])")
def _one_sided(
    two_before: Floats,
    before: Floats,
    here: Floats,
    after: Floats,
    two_after: Floats,
    left: Floats,
    right: Floats,
) -> None:
    """Left and right derivative (m,) of cells (m,), times their width.

    The nearer difference is corrected by half of a second difference: by the mean of the central
    one and the one beyond, with weights 2/3 and 1/3, which is of third order; by no more than twice
    the smaller of them, and not at all where their signs differ (Koren 1993).
    """
    for i in range(len(here)):
        from_left, to_right = here[i] - before[i], after[i] - here[i]
        central = to_right - from_left
        beyond = from_left - (before[i] - two_before[i])
        mean = (central + beyond) / 6 + central / 6
        most, least = max(min(central, beyond), 0.0), min(max(central, beyond), 0.0)
        left[i] = from_left + max(min(mean, most), least)
        beyond = (two_after[i] - after[i]) - to_right
        mean = (central + beyond) / 6 + central / 6
        most, least = max(min(central, beyond), 0.0), min(max(central, beyond), 0.0)
        right[i] = to_right - max(min(mean, most), least)


@compiled("void(in f8[:, ::1], i8, i8[:, :, ::1], b1, f8[::1], f8[:, ::1], f8[:, ::1])")
def _row_derivatives(
    values: Floats,
    row: int,
    beside: Ints,
    wraps: bool,
    padded: Floats,
    left: Floats,
    right: Floats,
) -> None:
    """One-sided derivatives (n, m) of one of the rows of values (rows, m); padded (m + 4,)."""
    last, m = len(beside), values.shape[1]
    here = values[row]
    for d in range(last):
        one, two, three, four = beside[d, row]
        _one_sided(values[one], values[two], here, values[three], values[four], left[d], right[d])
    for i in range(m + 4):
        padded[i] = here[(i - 2) % m if wraps else min(max(i - 2, 0), m - 1)]
    _one_sided(padded[:m], padded[1:-3], here, padded[3:-1], padded[4:], left[last], right[last])


@compiled("void(in f8[:, ::1], i8[:, :, ::1], b1, f8[:, :, ::1])")
def mean_derivatives(values: Floats, beside: Ints, wraps: bool, means: Floats) -> None:
    """The means (n, rows, m) of the one-sided derivatives of values (rows, m)."""
    n, rows, m = means.shape
    padded, left, right = np.empty(m + 4), np.empty((n, m)), np.empty((n, m))
    for row in range(rows):
        _row_derivatives(values, row, beside, wraps, padded, left, right)
        for d in range(n):
            for i in range(m):
                means[d, row, i] = (left[d, i] + right[d, i]) / 2


@compiled("void(f8[:, ::1], f8, f8[:, :, ::1], i8[::1], i8[:, ::1], i8[:, :, ::1], b1, f8[:, ::1])")
def euler_step(
    values: Floats,
    step: float,
    rates: Floats,
    along: Ints,
    of_control: Ints,
    beside: Ints,
    wraps: bool,
    result: Floats,
) -> None:
    """V + step min{0, max_u grad V . h} (rows, m), upwind: a step of (9) from V (rows, m)."""
    (vertices, n), m = of_control.shape, values.shape[1]
    padded, left, right = np.empty(m + 4), np.empty((n, m)), np.empty((n, m))
    changes, best, total = np.empty((len(along), m)), np.empty(m), np.empty(m)
    for row in range(len(values)):
        _row_derivatives(values, row, beside, wraps, padded, left, right)
        for r in range(len(along)):
            rate, d = rates[r, row], along[r]
            for i in range(m):  # the right side's where the flow comes from there
                changes[r, i] = rate[i] * (right[d, i] if rate[i] > 0 else left[d, i])
        for i in range(m):
            best[i] = -np.inf
        for vertex in range(vertices):
            for i in range(m):
                total[i] = 0.0
            for d in range(n):
                change = changes[of_control[vertex, d]]
                for i in range(m):
                    total[i] += change[i]
            for i in range(m):
                best[i] = max(best[i], total[i])
        for i in range(m):
            result[row, i] = values[row, i] + step * min(best[i], 0.0)
