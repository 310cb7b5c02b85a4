"""Parquet tables, nested state columns too: only the columns that are used are read."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mlci.recordings.arrays import table_of_arrays
from mlci.recordings.table import Table, Unusable, Wants, refuse_large

_LONG = 200  # characters of a name


def read(file: Path, wants: Wants, limit: int) -> Table:
    """A parquet table.

    Args:
        file: the table.
        wants: which columns to read.
        limit: bytes that they may take.

    Raises:
        Unusable: pyarrow is not there, or columns that are too large, or twice there, or lists
            of different lengths.
    """
    try:
        from pyarrow import parquet
    except ImportError:
        raise Unusable("reading .parquet needs pyarrow: pip install pyarrow") from None
    with parquet.ParquetFile(file) as source:
        schema = source.schema_arrow
        names, parts = list(schema.names), [_parts(field) for field in schema]
        used = [name for name, own in zip(names, parts, strict=True) if any(map(wants, own))]
        if twice := [name for name, count in Counter(used).items() if count > 1]:
            raise Unusable(f"has two columns {twice[0]!r}: rename or remove one")
        size = _claimed_bytes(source.metadata, set(used))
        refuse_large(size, limit)
        data = source.read(columns=used)
    arrays: dict[str, Any] = {}
    for name in used:
        arrays |= _arrays(name, data.column(name).to_pandas())
    return table_of_arrays(file, arrays, [n for own in parts for n in own if n not in arrays])


def _parts(field: Any) -> list[str]:
    """Names of the columns that a field of the file becomes: several where it has names inside."""
    from pyarrow import types

    if not types.is_struct(field.type):
        return [_joined(field.name)]
    inside = (field.type.field(i).name for i in range(field.type.num_fields))
    return [field.name, *(f"{field.name}.{name}" for name in inside)]


def _joined(name: str) -> str:
    """The name of a column; with dots where pandas wrote names of several levels as a tuple."""
    if not (name.startswith("('") and len(name) < _LONG):
        return name
    try:
        return ".".join(str(part) for part in ast.literal_eval(name) if part != "")
    except (ValueError, SyntaxError):
        return name


def _claimed_bytes(metadata: Any, used: set[str]) -> float:
    """What some columns will take, as the description says: 8 bytes a number at least."""
    size = 0.0
    for number in range(metadata.num_row_groups):
        group = metadata.row_group(number)
        for place in range(group.num_columns):
            column = group.column(place)
            if column.path_in_schema.partition(".")[0] in used:
                size += max(column.total_uncompressed_size, 8 * column.num_values)
    return size


def _arrays(name: str, column: pd.Series[Any]) -> dict[str, Any]:
    """A column as arrays (R,) by name, or (R, d) where each row is a list of d numbers."""
    first = column.iloc[0] if len(column) else None
    if isinstance(first, dict):
        return {
            f"{name}.{part}": pd.Series([(row or {}).get(part) for row in column]) for part in first
        }
    if not isinstance(first, np.ndarray | list):
        return {_joined(name): column}
    try:
        return {name: np.stack([np.asarray(row, dtype=float) for row in column])}
    except (TypeError, ValueError):
        raise Unusable(f"column {name!r} has lists of different lengths, or not numbers") from None
