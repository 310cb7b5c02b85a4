"""Noise of a recorded path, and single bad samples, from the path itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from mlci.spaces import Floats
from mlci.systems import System

_TO_DEVIATION = 1.4826  # of a normal distribution, from the median of absolute values
_REACH = 5  # samples on either side with which a sample is compared
_UNUSUAL = 8.0  # standard deviations
_SELDOM = 0.05  # of the samples: where more stand out, the path is not what it claims


def noise(path: Floats, time: Floats) -> Floats:
    """Standard deviation (n,) of the samples round a smooth path [unit of x]; 0 if there are few.

    Each sample is compared with the cubic through the two before and the two after it; the median
    of the residuals does not heed a few bad samples. Where a path bends within a sample's time,
    that counts as noise too.

    Args:
        path: (K+1, n) without jumps in periodic dimensions.
        time: (K+1,) of the samples [s], rising.
    """
    if len(path) < 2 * _REACH + 1:
        return np.zeros(path.shape[1])
    near = [slice(i, len(path) - 4 + i) for i in range(5)]
    middle, others = time[near[2]], [time[near[i]] for i in (0, 1, 3, 4)]
    residual, size = path[near[2]].copy(), np.ones(len(middle))
    for i, at in zip((0, 1, 3, 4), others, strict=True):
        weight = np.ones(len(middle))
        for other in others:
            if other is not at:
                weight *= (middle - other) / (at - other)
        residual -= weight[:, None] * path[near[i]]
        size += weight**2
    scaled = np.abs(residual) / np.sqrt(size)[:, None]
    return np.asarray(_TO_DEVIATION * np.median(scaled, axis=0))


@dataclass(frozen=True)
class Spike:
    """Samples that jump out and back.

    Attributes:
        first: number of the first sample.
        last: number of the last.
        dimension: in which the jump is widest.
        size: of the jump [unit of x].
    """

    first: int
    last: int
    dimension: int
    size: float


def spikes(system: System, path: Floats, time: Floats) -> list[Spike]:
    """Where at most five samples stand out from those around by more than the dynamics allow.

    A sample is compared with the median of the eleven around it, which a path that goes one way
    does not leave. It stands out if it is away by more than 8 standard deviations of the noise and
    by more than the fastest motion of the window covers there. Where more than a twentieth of the
    samples do, none is a spike: such a path is no motion of the system.

    Args:
        system: the dynamics and the control box.
        path: (K+1, n) without jumps in periodic dimensions.
        time: (K+1,) of the samples [s], rising.
    """
    if len(path) < 2 * _REACH + 1:
        return []
    # The ends, repeated, are most of their own windows, so that no end is a spike.
    longer = np.pad(path, ((_REACH, _REACH), (0, 0)), mode="edge")
    windows = sliding_window_view(longer, 2 * _REACH + 1, axis=0)
    middle = np.partition(windows, _REACH)[..., _REACH]  # the median
    away = np.abs(path - middle)
    fastest = np.zeros(path.shape[1])
    for control in system.control_box.vertices():
        rates = system.dynamics(middle, np.broadcast_to(control, (len(path), len(control))))
        fastest = np.maximum(fastest, np.max(np.abs(rates), axis=0))
    limit = np.maximum(_UNUSUAL * noise(path, time), fastest * np.median(np.diff(time)) * _REACH)
    excess = np.max(away / np.where(limit > 0, limit, np.inf), axis=1)
    out = np.flatnonzero(excess > 1)
    if len(out) > _SELDOM * len(path):
        return []
    runs = np.split(out, np.flatnonzero(np.diff(out) > 1) + 1) if len(out) else []
    found = []
    for run in runs:
        row = run[int(np.argmax(excess[run]))]
        d = int(np.argmax(away[row] / np.where(limit > 0, limit, np.inf)))
        found.append(Spike(int(run[0]), int(run[-1]), d, float(away[row, d])))
    return found
