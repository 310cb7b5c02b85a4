"""Derivatives of a function of states by central differences.

Complex steps would be exact, but are silently wrong where a function takes a modulus or fills a
real array.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mlci.spaces import Floats

# Nudges of differences of first and second order, at which rounding and curvature err alike.
_FIRST, _SECOND = np.finfo(float).eps ** (1 / 3), np.finfo(float).eps ** (1 / 4)


def first_derivatives(function: Callable[[Floats], Floats], point: Floats) -> Floats:
    """Derivatives of a function by the last axis of its argument, good to some nine digits.

    Args:
        function: takes points (..., k) to values (..., j), whose leading shape may be larger.
        point: (..., k).

    Returns:
        (..., j, k).
    """
    columns = []
    for d in range(point.shape[-1]):
        nudge = _nudge(point, d, _FIRST)
        above, below = point + nudge, point - nudge
        width = above[..., d] - below[..., d]  # as rounded
        columns.append((function(above) - function(below)) / width[..., None])
    return np.stack(columns, axis=-1)


def second_derivatives(function: Callable[[Floats], Floats], point: Floats) -> Floats:
    """Hessian (..., k, k) of a function at points (..., k), good to some six digits.

    Args:
        function: takes points (..., k) to values (...,).
        point: (..., k).
    """
    size = point.shape[-1]
    hessian = np.empty((*point.shape, size))
    for i in range(size):
        a = _nudge(point, i, _SECOND)
        for j in range(i + 1):
            b = _nudge(point, j, _SECOND)
            along = function(point + a + b) + function(point - a - b)
            across = function(point + a - b) + function(point - a + b)
            bend = (along - across) / (4 * a[..., i] * b[..., j])
            hessian[..., i, j] = hessian[..., j, i] = bend
    return hessian


def _nudge(point: Floats, d: int, share: float) -> Floats:
    """(..., k) a step along dimension d, in proportion to the coordinate where that is large."""
    nudge = np.zeros(point.shape)
    nudge[..., d] = share * np.maximum(1.0, np.abs(point[..., d]))
    return nudge
