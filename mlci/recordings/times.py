"""Times of samples: from whatever a file holds to rising seconds."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from mlci.recordings.units import converted
from mlci.spaces import Floats

MOST_STEPS = 100_000  # of the tabular model in one demonstration
MAX_DURATION = 1000.0  # [s], 200 times the paper's horizon
# Seconds since 1970 of the years 2001 to 2096, and the same in smaller units.
_UNIX = {unit: (1e9 * factor, 4e9 * factor) for unit, factor in
         {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}.items()}  # fmt: skip
_CLOCK = re.compile(r"^(?:(\d{1,4}):)?(\d{1,4}):(\d{1,2}(?:[.,]\d*)?)$")
_DAY = 86400.0  # [s]
_NEARLY_A_DAY = 0.9 * _DAY
_MOST_SECONDS = 1e15  # beyond, digits of a second are lost
_EXACT = 1e-9  # [s]: finer resolutions need no rounding


def seconds(
    column: pd.Series[Any], unit: str | None, place: Callable[[int], str]
) -> tuple[Floats, float, str]:
    """A column of times in seconds.

    Timestamps, durations and Unix times begin at 0; other numbers keep their origin.

    Args:
        column: (R,) numbers, timestamps, durations, or text of either.
        unit: of numbers; None takes seconds, or a finer unit where numbers look like Unix times.
        place: where a row stands.

    Returns:
        The times (R,), NaN where there is none; what they are exact to [s]; what was assumed.

    Raises:
        ValueError: what is neither number, timestamp nor duration, or a unit that is not of time.
    """
    if column.dtype.kind not in "iuf":
        if column.dtype.kind in "mM":
            return _since_first(column), _EXACT, ""
        numbers = pd.to_numeric(column, errors="coerce")
        bad = numbers.isna() & column.notna()
        if bad.any():
            if (clock := _clock(column)) is not None:
                return clock
            moments = None if numbers.notna().any() else _moments(column)
            if moments is None:
                row = int(np.argmax(bad))
                raise ValueError(
                    f"{place(row)}: time {str(column.iloc[row])[:40]!r} is neither a number nor a "
                    "timestamp"
                )
            return _since_first(moments), _EXACT, ""
        column = numbers
    return _of_numbers(column, unit)


def rising(times: Floats, resolution: float, place: Callable[[int], str]) -> Floats:
    """Times (K+1,) of one demonstration from 0, without the rounding of their last digit.

    Args:
        times: (K+1,) times [s].
        resolution: what they are exact to [s].
        place: where a sample stands.

    Raises:
        ValueError: a time that is no number, or not later than the one before.
    """
    bad = ~(np.diff(times) > 0)
    if bad.any():
        sample = int(np.argmax(bad)) + 1
        raise ValueError(
            f"{place(sample)}: time goes from {times[sample - 1]:.12g} to {times[sample]:.12g} s, "
            "where each sample must be later than the one before"
        )
    start = times - times[:1]
    if resolution > _EXACT:
        rounded = np.round(start, int(np.floor(-np.log10(resolution))))
        if np.all(np.diff(rounded) > 0):
            return rounded
    return start


def refuse_long(duration: float, dt: float, longest: float = MAX_DURATION) -> None:
    """Refuse a demonstration that would take too long.

    Args:
        duration: of the demonstration [s].
        dt: time step of the tabular model [s].
        longest: duration to allow [s].

    Raises:
        ValueError: more than `longest`, or than `MOST_STEPS` steps.
    """
    steps = duration / dt
    if duration > longest or steps > MOST_STEPS:
        raise ValueError(
            f"lasts {duration:g} s, {steps:.0f} steps of {dt:g} s: is time in ms? then "
            f"time_unit=ms; else allow it by max_duration (up to {MOST_STEPS} steps)"
        )


def _of_numbers(column: pd.Series[Any], unit: str | None) -> tuple[Floats, float, str]:
    """Numbers as seconds."""
    values: Any = column.to_numpy()
    rounding = float(np.finfo(values.dtype).eps) if values.dtype.kind == "f" else 0.0
    note = ""
    if values.dtype.kind not in "iu":
        values = values.astype(float)
    known = values[np.isfinite(values.astype(float))]
    if not len(known):
        return np.full(len(values), np.nan), 0.0, ""
    looks = [name for name, (low, high) in _UNIX.items() if np.all((known > low) & (known < high))]
    if looks:
        values = values - known[0]  # exact in integers, before anything is rounded
    if unit is None:
        unit = looks[0] if looks else "s"
        if unit != "s":
            note = f"time is taken for Unix time in {unit}, by its size"
    error = float(rounding * np.max(np.abs(known.astype(float))))
    times = converted(values.astype(float), unit, "s")
    if (farthest := float(np.max(np.abs(times[np.isfinite(times)])))) > _MOST_SECONDS:
        raise ValueError(f"holds a time of {farthest:g} s: is its unit {unit}? say so by time_unit")
    scale = float(converted(np.array([1.0]), unit, "s")[0])
    return times, max(error * scale, _printed(times)), note


def _printed(times: Floats) -> float:
    """Half of the last digit that times are printed with [s]; 0 where they have too many."""
    finite = times[np.isfinite(times)]
    for digits in range(7):
        if np.allclose(np.round(finite, digits), finite, rtol=1e-13, atol=1e-13):
            return 0.5 * 10.0**-digits
    return 0.0


def _clock(column: pd.Series[Any]) -> tuple[Floats, float, str] | None:
    """Text of hours, minutes and seconds, or of the last two, as `seconds`; None if it is other.

    From one midnight to the next hours begin anew.
    """
    parts = column.astype("string").str.strip().str.extract(_CLOCK)
    if not parts[2].notna().equals(column.notna()) or parts[2].isna().all():
        return None
    seconds_ = parts[2].str.replace(",", ".").astype(float)
    hours, minutes = parts[0].astype(float), parts[1].astype(float)
    has_hours = hours.notna().any()
    time = np.array(3600 * hours.fillna(0.0) + 60 * minutes + seconds_, dtype=float)
    known = np.flatnonzero(np.isfinite(time))
    if has_hours:
        days = np.cumsum(np.diff(time[known]) < -_NEARLY_A_DAY)
        time[known[1:]] += _DAY * days
    note = "" if has_hours else "time is taken for minutes and seconds"
    return time - time[known[0]], _EXACT, note


def _moments(column: pd.Series[Any]) -> pd.Series[Any] | None:
    """Text as timestamps or durations; None where some is neither."""
    text = column.astype("string").str.strip()
    if text.str.fullmatch(r"[\d.,+ -]*").any():
        return None  # numbers, with whatever between thousands
    readers: tuple[Callable[[], Any], ...] = (
        lambda: pd.to_datetime(text, format="ISO8601", utc=True),
        lambda: pd.to_timedelta(text),
        lambda: pd.to_datetime(text, format="mixed", utc=True),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for read in readers:
            try:
                moments: pd.Series[Any] = read()
            except (ValueError, TypeError, OverflowError):
                continue
            return moments
    return None


def _since_first(column: pd.Series[Any]) -> Floats:
    """Timestamps or durations as seconds since the first."""
    known = column.dropna()
    if known.empty:
        return np.full(len(column), np.nan)
    since: Any = column - known.iloc[0]
    return np.asarray(since.dt.total_seconds(), dtype=np.float64)
