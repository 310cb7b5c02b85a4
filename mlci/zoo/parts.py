"""What the systems of this room are put together from: checks, boxes, rates and Jacobians."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System


def require_positive(system: System) -> None:
    """Refuse a system any of whose parameters is not a positive finite number.

    Raises:
        ValueError: names the class, the parameter and its value.
    """
    for name, value in vars(system).items():
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{type(system).__name__}.{name} must be positive, not {value}")


def symmetric_box(*limits: float) -> Box:
    """The box from minus to plus each limit."""
    return Box(-np.array(limits), np.array(limits))


def limited_space(
    names: Sequence[str], units: Sequence[str], limits: Sequence[float | None]
) -> StateSpace:
    """A state space from minus to plus each limit; None is an angle, which goes from 0 to 2 pi."""
    lower = [0.0 if limit is None else -limit for limit in limits]
    upper = [2 * np.pi if limit is None else limit for limit in limits]
    periodic = np.array([limit is None for limit in limits])
    return StateSpace(Box(np.array(lower), np.array(upper)), periodic, tuple(names), tuple(units))


def batch_of(states: Floats, controls: Floats) -> tuple[int, ...]:
    """The leading shape that states (..., n) and controls (..., m) have together."""
    return np.broadcast_shapes(states.shape[:-1], controls.shape[:-1])


def rates(states: Floats, controls: Floats, rows: Sequence[ArrayLike]) -> Floats:
    """Derivatives (..., n) from n rates, each (...,) or a number."""
    # Each dimension is contiguous: numpy is slow along so short an axis.
    stacked = np.empty((len(rows), *batch_of(states, controls)))
    for d, row in enumerate(rows):
        stacked[d] = row
    return np.moveaxis(stacked, 0, -1)


def matrix(states: Floats, controls: Floats, rows: Sequence[Sequence[ArrayLike]]) -> Floats:
    """A Jacobian (..., n, k) from n rows of k entries, each (...,) or a number."""
    filled = np.empty((*batch_of(states, controls), len(rows), len(rows[0])))
    for d, row in enumerate(rows):
        for k, entry in enumerate(row):
            filled[..., d, k] = entry
    return filled
