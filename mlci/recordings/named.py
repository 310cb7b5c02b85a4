"""From a table as it stands in a file to a recording: the system's names and units, and seconds."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from mlci.demonstrations import even_times
from mlci.recordings.columns import (
    STATES,
    TIMES,
    control_columns,
    header_unit,
    plain_name,
    position,
    shortened,
    trailing_unit,
)
from mlci.recordings.recording import Layout, Recording, goal_columns
from mlci.recordings.table import NoRecording, Table
from mlci.recordings.times import seconds
from mlci.recordings.units import converted, fits, in_degrees
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System

_ALIKE = 0.4  # share of letters in common, from which a name is offered
SAMPLES = "samples"  # as a unit of time: the number of a sample


def to_recording(table: Table, system: System, layout: Layout) -> Recording:
    """A table in the names and units of a system.

    Args:
        table: what a file holds.
        system: whose states are sought.
        layout: what the user says about names and units.

    Raises:
        ValueError: a column that is missing, there twice, no number, or in a unit that does not
            fit.
    """
    space = system.space
    if not table.header:
        return _without_header(table, system, layout)
    headers = [str(name) for name in table.columns.columns]
    places, beside = _state_places(headers, space, layout), _places_beside(headers, system, layout)
    time, notes = _time_place(headers, layout), list[str]()
    used = {*places.values(), *beside.values(), time}
    others = [header for i, header in enumerate(headers) if i not in used and header.strip()]
    _refuse_missing(table, [*others, *table.others], places, time, space, layout)
    if time is None:
        times, resolution = even_times(len(table.columns), _own_dt(table, layout)), 0.0
        if "dt" not in table.fixed:
            notes.append(f"no time: samples are taken to be {layout.dt:g} s apart")
    else:
        times, resolution = _seconds(table, headers[time], time, layout, notes)
    columns: dict[str, Any] = {"time": times}
    for d, name in enumerate(space.names):
        if name in places:
            columns[name] = _state(table, headers[places[name]], places[name], d, space, layout)
    for name, place in beside.items():
        column = table.columns.iloc[:, place]
        columns[name] = column.to_numpy() if name in layout.keep else _lenient(column)
    frame = pd.DataFrame(columns)
    return Recording(table, frame, resolution, _goal(table, space), False, tuple(notes))


def _state_places(headers: Sequence[str], space: StateSpace, layout: Layout) -> dict[str, int]:
    """Positions of the states that are there: by their names, or as entries of one array."""
    places: dict[str, int] = {}
    array = layout.columns.get(STATES, STATES)
    for d, name in enumerate(space.names):
        place = position(name, headers, layout.columns.get(name))
        if place is None and name not in layout.columns:
            place = position(f"{array}[{d}]", headers)
        for other, taken in places.items():
            if taken == place:
                raise ValueError(
                    f"column {headers[taken]!r} is named for {other} and for {name}: columns= "
                    "needs a column for each"
                )
        if place is not None:
            places[name] = place
    entries = [header for header in headers if header.startswith(f"{array}[")]
    if entries and len(entries) != space.dimension and f"{array}[0]" in headers:
        raise ValueError(
            f"needs an array {array!r} of shape (K+1, {space.dimension}), not (K+1, {len(entries)})"
        )
    return places


def _places_beside(headers: Sequence[str], system: System, layout: Layout) -> dict[str, int]:
    """Positions of controls and a goal, where all of them are there, and of what is kept."""
    places: dict[str, int] = {}
    controls, count = control_columns(system), system.control_box.dimension
    entries = ["controls"] if count == 1 else [f"controls[{i}]" for i in range(count)]
    for ours, theirs in (
        (controls, controls),
        (controls, entries),
        (goal_columns(system.space),) * 2,
    ):
        there = [position(name, headers) for name in theirs]
        if None not in there:
            places |= {name: place for name, place in zip(ours, there, strict=True)}  # type: ignore[misc]
    for name in layout.keep:
        place = position(name, headers, layout.columns.get(name))
        if place is not None:
            places[name] = place
    return places


def _state(
    table: Table, header: str, place: int, d: int, space: StateSpace, layout: Layout
) -> Floats:
    """Dimension d of the states (R,), in the system's unit."""
    name, own = space.names[d], space.units[d]
    values = _column(table, place)
    try:
        stated = layout.units.get(name) or _unit(table, header, name, own)
        return converted(values, own if stated is None else stated, own)
    except ValueError as error:
        raise ValueError(
            f"column {header!r}: {error}; or say its unit, as in units={{{name}: {own or '1'}}}"
        ) from None


def _time_place(headers: Sequence[str], layout: Layout) -> int | None:
    """Where time stands; None where the file has none."""
    if given := layout.columns.get("time"):
        return position("time", headers, given)
    return next((p for name in TIMES if (p := position(name, headers)) is not None), None)


def _refuse_missing(
    table: Table,
    others: Sequence[str],
    places: Mapping[str, int],
    time: int | None,
    space: StateSpace,
    layout: Layout,
) -> None:
    """Refuse a table that lacks a column, with how to name it.

    Without time, samples are `Layout.dt` apart; but not where a column that nobody knows may be it.
    """
    missing = [name for name in space.names if name not in places and name not in layout.derived]
    tells = "dt" in table.fixed or layout.time_unit == SAMPLES
    if time is None and ("time" in layout.columns or (not tells and (missing or others))):
        missing.insert(0, "time")
    if not missing:
        return
    names = [*map(str, table.columns.columns), *table.others]
    if {"trial"} < {plain_name(n).partition("_")[0] for n in names} <= {"trial", "start", "goal"}:
        raise NoRecording("is a table of starts and goals (tasks=FILE)")
    alike = difflib.get_close_matches(missing[-1], others, 1, _ALIKE)
    offered = alike if len(others) > 1 else others
    example = f"columns={{{missing[-1]}: {offered[0] if offered else 'NAME'}}}"
    array = f" (or columns={{{STATES}: NAME}} for an array of all)" if len(missing) > 1 else ""
    without = f"; without time, time_unit={SAMPLES}" if missing == ["time"] else ""
    sought = [layout.columns.get(name, name) for name in missing]
    raise ValueError(
        f"has no column {' or '.join(sought)} in its header ({shortened(names)}): it needs "
        f"{', '.join(['time', *space.names])}; if they have other names there, say so, as in "
        f"{example}{array}{without}"
    )


def _own_dt(table: Table, layout: Layout) -> float:
    """The time step of a file without times [s]."""
    dt = float(table.fixed.get("dt", layout.dt))
    if not (np.isfinite(dt) and dt > 0):
        raise ValueError(f"needs a time step dt above 0, not {dt:g} s")
    return dt


def _seconds(
    table: Table, header: str, place: int, layout: Layout, notes: list[str]
) -> tuple[Floats, float]:
    """The times of a table [s], and what they are exact to."""
    unit = layout.time_unit or _unit(table, header, "", "s")
    if unit == SAMPLES:
        return _column(table, place) * _own_dt(table, layout), 0.0
    try:
        times, resolution, note = seconds(table.columns.iloc[:, place], unit, table.place)
    except ValueError as error:
        raise ValueError(f"column {header!r}: {error}") from None
    if note:
        notes.append(note)
    return times, resolution


def _unit(table: Table, header: str, name: str, own: str) -> str | None:
    """The unit of a column as the file states it; None where it does not.

    A last word of a header may also be part of a name, as in theta_m: it is a unit if the rest is
    our name of the column, or if it measures what our unit does.
    """
    if stated := table.units.get(header) or header_unit(header):
        return stated
    bare, word = trailing_unit(header)
    if word and plain_name(header) != plain_name(name):
        last = bare.rpartition(".")[2]
        if plain_name(name) in map(plain_name, (bare, last)) or fits(word, own):
            return word
    return in_degrees(own) if table.fixed.get("in_degrees") and name else None


def _column(table: Table, place: int) -> Floats:
    """A column by its position, as numbers (R,)."""
    header = table.columns.columns[place]
    return _numbers(
        table.columns.iloc[:, place], lambda row: f"{table.place(row)}, column {header!r}"
    )


def _numbers(column: pd.Series[Any], place: Callable[[int], str]) -> Floats:
    """A column as numbers (R,), NaN where it is empty."""
    if column.dtype.kind in "fiu":
        return np.asarray(column, dtype=np.float64)
    values = _lenient(column)
    bad = np.isnan(values) & column.notna().to_numpy()
    if bad.any() or column.dtype.kind in "bcmM":
        row = int(np.argmax(bad))
        text = str(column.iloc[row]).strip()[:40] if len(column) else ""
        raise ValueError(f"{place(row)}: {text!r} is not a number")
    return values


def _lenient(column: pd.Series[Any]) -> Floats:
    """A column as numbers (R,), NaN where it holds none."""
    if column.dtype.kind in "fiu":
        return np.asarray(column, dtype=np.float64)
    if column.dtype.kind in "bcmM":
        return np.full(len(column), np.nan)
    numbers: Any = pd.to_numeric(column, errors="coerce")
    return np.asarray(numbers, dtype=np.float64)


def _goal(table: Table, space: StateSpace) -> Box | None:
    """The goal that a file states once."""
    corners: list[Any] = [table.fixed.get(f"goal_{end}") for end in ("lower", "upper")]
    if any(corner is None for corner in corners):
        return None
    if any(np.shape(corner) != (space.dimension,) for corner in corners):
        raise ValueError(f"needs 'goal_lower' and 'goal_upper' of shape ({space.dimension},)")
    return box_of(np.array(corners, dtype=float))


def box_of(corners: Floats) -> Box:
    """A goal from its corners (2, n)."""
    if corners.shape[0] != 2 or np.any(np.isnan(corners)) or np.any(corners[0] > corners[1]):
        raise ValueError(f"has a goal that is no box: {corners.tolist()}")
    return Box(*corners)


def _without_header(table: Table, system: System, layout: Layout) -> Recording:
    """A table of numbers alone: a line a dimension, or a column a dimension."""
    space, n, m = system.space, system.space.dimension, system.control_box.dimension
    rows, width = table.columns.shape
    by_line = rows in (n, n + m)
    if not by_line and not (width == n and rows > n + m + 1):
        raise ValueError(
            f"has no header and {rows} lines of {width} values: it needs {n} lines (the states) or "
            f"{n + m} (states and controls), one column a sample, or a header line that begins "
            f"{','.join(['time', *space.names])}"
        )
    names = [*space.names, *control_columns(system)][: rows if by_line else n]
    columns = {"time": even_times(width if by_line else rows, layout.dt)}
    cells = table.columns.T if by_line else table.columns

    def place(row: int, column: int) -> str:
        line = table.place(column if by_line else row)
        return f"{line}, column {(row if by_line else column) + 1}"

    for d, name in enumerate(names):
        if d >= n:
            columns[name] = _lenient(cells.iloc[:, d])
            continue
        columns[name] = _numbers(cells.iloc[:, d], partial(place, column=d))
        if name in layout.units:
            columns[name] = converted(columns[name], layout.units[name], space.units[d])
    notes = () if by_line else (f"no time: samples are taken to be {layout.dt:g} s apart",)
    return Recording(table, pd.DataFrame(columns), 0.0, None, by_line, notes)
