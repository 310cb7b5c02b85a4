"""Velocities that were not recorded: smooth derivatives of what was, by Savitzky and Golay."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
import scipy  # loads scipy.signal, which takes half a second, when it is first used

from mlci.spaces import Floats, StateSpace

_DEGREE = 3  # of the polynomial in a window
_FEWEST = 5  # samples in a window, which a cubic does not meet all
_EVEN = 0.01  # of a step


def derive(
    frame: pd.DataFrame, space: StateSpace, derived: Mapping[str, str], window: float
) -> pd.DataFrame:
    """A trial with the derivatives of some of its states.

    In each window a cubic is fitted; uneven times are interpolated at even ones for that, as many
    as there are samples. A derivative that was recorded is replaced.

    Args:
        frame: `time` [s], rising, and states without gaps.
        space: the state space.
        derived: for the name of each derivative that of its state.
        window: of the cubics [s].

    Raises:
        ValueError: too few samples in the trial or the window.
    """
    time = frame["time"].to_numpy(dtype=float)
    frame, missing = frame.copy(), [name for name in derived.values() if name not in frame]
    if missing:
        raise ValueError(f"has no column {' or '.join(missing)} to derive from")
    for name, of in derived.items():
        values = _unwrapped(space, of, frame[of].to_numpy(dtype=float))
        frame[name] = smooth_derivative(values, time, window)
    return frame


def smooth_derivative(values: Floats, time: Floats, window: float) -> Floats:
    """Derivative (K+1,) of values at rising times [s], from cubics over windows [s].

    Raises:
        ValueError: too few samples in all or in a window.
    """
    count = len(values)
    lasts = float(time[-1] - time[0]) if count else 0.0
    if count < _FEWEST:
        raise ValueError(f"has {count} samples; a derivative needs at least {_FEWEST}")
    step = lasts / (count - 1)
    size = 2 * int(window / step / 2 + 1e-9) + 1  # samples, odd
    if size < _FEWEST:
        raise ValueError(
            f"has {size} samples in a window of {window:g} s, {step:.3g} s apart; a derivative "
            f"needs {_FEWEST}: derive_window={(_FEWEST - 1) * step * 1.01:.2g} or more"
        )
    if size > count:
        raise ValueError(f"lasts {lasts:g} s, less than derive_window={window:g}")
    even = time[0] + step * np.arange(count)
    is_even = np.all(np.abs(time - even) <= _EVEN * step)
    samples = values if is_even else np.interp(even, time, values)
    slope = scipy.signal.savgol_filter(samples, size, _DEGREE, deriv=1, delta=step)
    return np.asarray(slope if is_even else np.interp(time, even, slope))


def _unwrapped(space: StateSpace, name: str, values: Floats) -> Floats:
    """A state's values (K+1,) without jumps."""
    path = np.zeros((len(values), space.dimension))
    d = space.names.index(name)
    path[:, d] = values
    return np.asarray(space.unwrap(path)[:, d])
