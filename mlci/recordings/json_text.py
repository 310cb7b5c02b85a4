"""JSON: a list of records, or an object of arrays, one of which may hold all states."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mlci.recordings.arrays import table_of_arrays
from mlci.recordings.delimited import text_lines
from mlci.recordings.table import Table, Unusable, Wants


def read(file: Path, wants: Wants, _limit: int) -> Table:
    """A JSON file: records `[{"time": 0, ...}, ...]` or columns `{"time": [0, ...], ...}`.

    A column may also be an object of values by row number, as pandas writes by default; records may
    be lines.

    Raises:
        Unusable: no JSON, or neither records nor columns.
    """
    content = _content(text_lines(file))
    if isinstance(content, list) and content and all(isinstance(row, dict) for row in content):
        names = list(dict.fromkeys(name for row in content for name in row))
        columns = {name: [row.get(name) for row in content] for name in names}
    elif isinstance(content, dict):
        columns = content
    else:
        raise Unusable("holds neither a list of records nor an object of columns")
    used = {name: _array(name, value) for name, value in columns.items() if wants(name)}
    return table_of_arrays(file, used, [name for name in columns if name not in used])


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
