"""JSON: a list of records, or an object of arrays, one of which may hold all states."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mlci.recordings.arrays import table_of_arrays
from mlci.recordings.columns import TIMES, plain_name
from mlci.recordings.delimited import text_lines
from mlci.recordings.table import NoRecording, Table, Unusable, Wants

_FEW = 10  # numbers in a list, of which metadata has fewer


def read(file: Path, wants: Wants, _limit: int) -> Table:
    """A JSON file: records `[{"time": 0, ...}, ...]` or columns `{"time": [0, ...], ...}`.

    A column may also be an object of values by row number, as pandas writes by default; records may
    be lines, or stand beside metadata; columns of an object inside have names such as `hip.angle`.

    Raises:
        NoRecording: nothing but metadata.
        Unusable: no JSON, or neither records nor columns.
    """
    content = _content(text_lines(file))
    columns = _flat(content) if isinstance(content, dict) else {"": content}
    lists = [value for value in columns.values() if _are_records(value)]
    arrays = [name for name, value in columns.items() if isinstance(value, list) and wants(name)]
    if len(lists) == 1 and not arrays:  # the samples, perhaps beside what holds for all
        rows = [_flat(row) for row in lists[0]]
        names = list(dict.fromkeys(name for row in rows for name in row))
        columns = {name: [row.get(name) for row in rows] for name in names}
        time = next((name for name in names if plain_name(name) in TIMES), None)
        if time is not None and all(isinstance(row.get(time), list) for row in rows):
            columns = _trials(rows, names, time)
    if not isinstance(content, dict) and not lists:
        raise Unusable("holds neither a list of records nor an object of columns")
    used = {name: _array(name, value) for name, value in columns.items() if wants(name)}
    longest = max((len(value) for value in columns.values() if isinstance(value, list)), default=0)
    if longest < _FEW and not any(array.ndim for array in used.values()):
        raise NoRecording("is JSON without samples")
    return table_of_arrays(file, used, [name for name in columns if name not in used])


def _flat(tree: dict[str, Any], above: str = "") -> dict[str, Any]:
    """The entries of objects within objects, by names that dots join.

    An object of values by row number is one entry.
    """
    flat: dict[str, Any] = {}
    for name, value in tree.items():
        if isinstance(value, dict) and not all(key.lstrip("-").isdigit() for key in value):
            flat |= _flat(value, f"{above}{name}.")
        else:
            flat[above + name] = value
    return flat


def _trials(rows: Sequence[dict[str, Any]], names: Sequence[str], time: str) -> dict[str, Any]:
    """The columns of several trials, each an object of lists; what is no list is repeated."""
    columns: dict[str, Any] = {name: [] for name in ("trial", *names)}
    for number, row in enumerate(rows, 1):
        count = len(row[time])
        for name, column in columns.items():
            value = row.get(name, number if name == "trial" else None)
            column += value if isinstance(value, list) else [value] * count
    return columns


def _are_records(value: Any) -> bool:
    """Whether a value is a list of objects."""
    return isinstance(value, list) and len(value) > 0 and all(isinstance(v, dict) for v in value)


def _content(lines: list[str]) -> Any:
    """What the text says."""
    try:
        return json.loads("\n".join(lines))
    except RecursionError:
        raise Unusable("is nested too deeply") from None
    except json.JSONDecodeError as error:
        rows = [line for line in lines if line.strip()]
        try:
            if len(rows) > 1:
                return [json.loads(line) for line in rows]
        except (json.JSONDecodeError, RecursionError):
            pass
        raise Unusable(f"line {error.lineno}: is not JSON ({error.msg})") from None


def _array(name: str, value: Any) -> Any:
    """The values of a column: numbers, text, or lists of numbers; null is no number."""
    if isinstance(value, dict):
        value = list(value.values())
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        pass
    if not isinstance(value, list) or any(isinstance(entry, list | dict) for entry in value):
        raise Unusable(f"{name!r} is not a list of numbers, or of equally long lists of numbers")
    return np.asarray(pd.Series(value, dtype=object))
