"""Parquet tables, nested state columns too: only the columns that are used are read."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mlci.recordings.arrays import table_of_arrays
from mlci.recordings.table import Table, Unusable, Wants


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
        raise Unusable("reading .parquet needs pyarrow: pip install 'mlci[parquet]'") from None
    with parquet.ParquetFile(file) as source:
        names = list(source.schema_arrow.names)
        used = [name for name in names if wants(name)]
        if twice := [name for name, count in Counter(used).items() if count > 1]:
            raise Unusable(f"has two columns {twice[0]!r}: rename or remove one")
        size = _claimed_bytes(source.metadata, set(used))
        if size > limit:
            raise Unusable(f"claims {size:.2g} bytes, more than the {limit:.2g} of max_memory")
        data = source.read(columns=used)
    arrays = {name: _array(name, data.column(name).to_pandas()) for name in used}
    return table_of_arrays(file, arrays, [name for name in names if name not in used])


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


def _array(name: str, column: pd.Series[Any]) -> Any:
    """A column as an array (R,), or (R, d) where each row is a list of d numbers."""
    first = column.iloc[0] if len(column) else None
    if isinstance(first, dict):
        return np.array([list(row.values()) for row in column], dtype=float)
    if not isinstance(first, np.ndarray | list):
        return column
    try:
        return np.stack([np.asarray(row, dtype=float) for row in column])
    except (TypeError, ValueError):
        raise Unusable(f"column {name!r} has lists of different lengths, or not numbers") from None
