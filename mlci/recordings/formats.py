"""File formats of recorded demonstrations.

They are told apart by suffix, and the two kinds of CSV by the first line:

* `.csv` with a header: a column `time` [s], one for each state dimension by its name, and
  optionally `control_1` to `control_m`; one line a sample. The goal may be there as well, in the
  first sample's line: `goal_lower_NAME` and `goal_upper_NAME` of each dimension, -inf and inf where
  it is free. Other columns are ignored.
* `.csv` without a header: one line for each state dimension, then none or one for each control; one
  column a sample, at a time step that the caller knows.
* `.npz`: `states` (K+1, n), `time` (K+1,) or `dt`, optionally `controls` (K, m) or (K+1, m), and
  `goal_lower` and `goal_upper` (n,).
* `.parquet`: the columns of the CSV with a header; needs the package pyarrow.

Only the states count. Controls come along where they are complete, and nothing is computed from
them; the control of the last sample, which acts after the end, is dropped.
"""

from __future__ import annotations

import csv
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System

# What numpy and pyarrow raise for damaged files.
_BROKEN = (ValueError, TypeError, OSError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)


@dataclass(frozen=True, eq=False)
class Recording:
    """What a file holds: states (K+1, n), controls or None, times (K+1,), and where each stands.

    The goal is None where the file does not say.
    """

    states: Floats
    controls: Floats | None
    time: Floats
    place: Callable[[int, int], str]  # of a sample and a dimension, to be named in a message
    goal: Box | None = None


def _read_csv(file: Path, system: System, dt: float) -> Recording:
    """A CSV file of either layout."""
    with file.open(newline="", encoding="utf-8-sig") as stream:
        try:
            reader = csv.reader(stream)
            rows = [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
        except (UnicodeDecodeError, csv.Error) as error:
            raise ValueError(f"is not comma-separated text ({error})") from None
    if not rows:
        raise ValueError("is empty")
    lines = [line for line, _ in rows]
    for line, row in rows:
        if len(row) != len(rows[0][1]):
            raise ValueError(
                f"line {line} has {len(row)} values where line {lines[0]} has {len(rows[0][1])}"
            )
    try:
        float(rows[0][1][0])
    except ValueError:
        return _from_columns(rows, system)
    return _from_rows(rows, system, dt)


def _from_columns(rows: list[tuple[int, list[str]]], system: System) -> Recording:
    """One line a sample, under a header."""
    header = [name.strip() for name in rows[0][1]]
    columns = _chosen(header, system)
    lines = [line for line, _ in rows[1:]]
    needed = 1 + system.space.dimension
    table = np.array(
        [
            [
                _number(row[header.index(name)], f"line {line}, column {name!r}", i < needed)
                for i, name in enumerate(columns)
            ]
            for line, row in rows[1:]
        ]
    ).reshape(-1, len(columns))
    return _from_table(table, columns, system, lambda sample, _: f"line {lines[sample]}")


def _from_rows(rows: list[tuple[int, list[str]]], system: System, dt: float) -> Recording:
    """One line a dimension, no header."""
    n, m = system.space.dimension, system.control_box.dimension
    if len(rows) not in (n, n + m):
        raise ValueError(
            f"has no header and {len(rows)} lines: it needs {n} lines (the states) or {n + m} "
            f"(states and controls), one column a sample, or a header line that begins "
            f"{','.join(['time', *system.space.names])}"
        )
    table = np.array(
        [
            [_number(text, f"line {line}, column {k + 1}", d < n) for k, text in enumerate(row)]
            for d, (line, row) in enumerate(rows)
        ]
    ).T
    lines = [line for line, _ in rows]
    time = np.arange(len(table)) * dt
    return _from_table(
        np.column_stack([time, table]),
        (),
        system,
        lambda sample, d: f"line {lines[d]}, column {sample + 1}",
    )


def _read_npz(file: Path, system: System, dt: float) -> Recording:
    """A numpy archive."""
    try:
        # numpy leaves a file of its own open where it is no archive.
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            arrays = {key: np.asarray(archive[key], dtype=float) for key in archive.files}
    except _BROKEN as error:
        raise ValueError(f"is not an archive of numeric arrays ({error})") from None
    n, states = system.space.dimension, arrays.get("states")
    if states is None or states.ndim != 2 or states.shape[1] != n:
        held = {key: array.shape for key, array in arrays.items()}
        raise ValueError(f"needs an array 'states' of shape (K+1, {n}); it holds {held}")
    time = arrays.get("time")
    if time is None:
        if "dt" not in arrays or arrays["dt"].size != 1:
            raise ValueError("needs an array 'time' of shape (K+1,) or a number 'dt' [s]")
        time = np.arange(len(states)) * arrays["dt"].item()
    if time.shape != (len(states),):
        raise ValueError(f"needs 'time' of shape ({len(states)},), not {time.shape}")
    controls, goal = _complete(arrays.get("controls"), len(states)), None
    if "goal_lower" in arrays and "goal_upper" in arrays:
        corners = arrays["goal_lower"], arrays["goal_upper"]
        if any(corner.shape != (n,) for corner in corners):
            raise ValueError(f"needs 'goal_lower' and 'goal_upper' of shape ({n},)")
        goal = _box(np.stack(corners))
    return Recording(states, controls, time, lambda sample, _: f"sample {sample}", goal)


def _read_parquet(file: Path, system: System, dt: float) -> Recording:
    """A parquet table."""
    try:
        from pyarrow import parquet
    except ImportError:
        raise ValueError("reading .parquet needs pyarrow: pip install 'mlci[parquet]'") from None
    try:
        data = parquet.read_table(file)
    except _BROKEN as error:
        raise ValueError(f"is not a parquet table ({error})") from None
    columns = _chosen(data.column_names, system)
    try:
        table = np.column_stack(
            [np.asarray(data.column(name).to_numpy(), dtype=float) for name in columns]
        )
    except (TypeError, ValueError) as error:
        raise ValueError(f"has a column that is not of numbers ({error})") from None
    return _from_table(table, columns, system, lambda sample, _: f"sample {sample}")


def _chosen(header: Sequence[str], system: System) -> list[str]:
    """Names of the columns to read: time, states, and the controls if all are there."""
    needed = ["time", *system.space.names]
    missing = [name for name in needed if name not in header]
    if missing:
        raise ValueError(
            f"has no column {' or '.join(missing)} in its header ({_shortened(header)}): it needs "
            f"{', '.join(needed)}"
        )
    controls = [f"control_{i + 1}" for i in range(system.control_box.dimension)]
    goal = goal_columns(system.space)
    there = set(header)
    return [*needed, *(name for group in (controls, goal) if set(group) <= there for name in group)]


def goal_columns(space: StateSpace) -> list[str]:
    """Names of the columns of a goal: its lower corner, then its upper."""
    return [f"goal_{end}_{name}" for end in ("lower", "upper") for name in space.names]


def _shortened(names: Sequence[str]) -> str:
    """The first few names."""
    return ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")


def _from_table(
    table: Floats, columns: Sequence[str], system: System, place: Callable[[int, int], str]
) -> Recording:
    """A recording from columns time, states and perhaps controls and a goal."""
    n, m = system.space.dimension, system.control_box.dimension
    rest, goal = table[:, n + 1 :], None
    if len(table) and columns[-1:] == goal_columns(system.space)[-1:]:
        rest, goal = rest[:, : -2 * n], _box(rest[:1, -2 * n :].reshape(-1, n))
    controls = rest if rest.shape[1] == m else None
    return Recording(table[:, 1 : n + 1], _complete(controls, len(table)), table[:, 0], place, goal)


def _box(corners: Floats) -> Box:
    """A goal from its corners (2, n)."""
    if corners.shape[0] != 2 or np.any(np.isnan(corners)) or np.any(corners[0] > corners[1]):
        raise ValueError(f"has a goal that is no box: {corners.tolist()}")
    return Box(*corners)


def _complete(controls: Floats | None, samples: int) -> Floats | None:
    """Controls (K, m) if there is a finite one for every sample but the last, else None."""
    if controls is None or controls.ndim != 2 or len(controls) not in (samples - 1, samples):
        return None
    held = controls[: samples - 1]
    return held if np.all(np.isfinite(held)) else None


def _number(text: str, place: str, needed: bool) -> float:
    """A number; NaN stands for a text that is none where that is not `needed`."""
    try:
        return float(text)
    except ValueError:
        if needed:
            raise ValueError(f"{place}: {text.strip()!r} is not a number") from None
        return float("nan")


READERS: dict[str, Callable[[Path, System, float], Recording]] = {
    ".csv": _read_csv,
    ".npz": _read_npz,
    ".parquet": _read_parquet,
}
