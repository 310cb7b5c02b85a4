"""Excel's .xlsx: the first sheet, whose first full line names the columns."""

from __future__ import annotations

import datetime
import itertools
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mlci.recordings.table import Table, Unusable, Wants, refuse_large

_COST = 20  # bytes of memory for one of the sheet's text
_MOST_COLUMNS = 1000


def read(file: Path, _wants: Wants, limit: int) -> Table:
    """The first sheet of a workbook.

    Args:
        file: the workbook.
        limit: bytes that reading may take.

    Raises:
        Unusable: openpyxl is not there, a workbook that is too large, or without a header.
    """
    try:
        import openpyxl
    except ImportError:
        raise Unusable("reading .xlsx needs openpyxl: pip install openpyxl") from None
    with zipfile.ZipFile(file) as archive:
        size = _COST * sum(entry.file_size for entry in archive.infolist())
    refuse_large(size, limit, "takes")
    book = openpyxl.load_workbook(file, read_only=True, data_only=True)
    try:
        sheet = book.worksheets[0]
        sheet.reset_dimensions()
        cells = limit // (8 * _COST)
        rows: list[tuple[int, tuple[Any, ...]]] = []
        for number, row in enumerate(sheet.iter_rows(values_only=True, max_col=_MOST_COLUMNS), 1):
            cells -= len(row)
            if cells < 0:
                raise Unusable(f"has more cells than fit into the {limit:.2g} bytes of max_memory")
            if any(cell is not None for cell in row):
                rows.append((number, row))
    finally:
        book.close()
    return _table(file, rows)


def _table(file: Path, rows: list[tuple[int, tuple[Any, ...]]]) -> Table:
    """A table from the rows of a sheet that hold anything, with their numbers."""
    if not rows:
        raise Unusable("has an empty first sheet")
    (first, header), samples = rows[0], rows[1:]
    names = [str(cell).strip() if cell is not None else "" for cell in header]
    if all(isinstance(cell, int | float) for cell in header):
        raise Unusable(f"line {first} holds numbers where it must name the columns")
    columns = list(itertools.zip_longest(*(row for _, row in samples)))[: len(names)]
    columns += [(None,) * len(samples)] * (len(names) - len(columns))
    frame = pd.DataFrame({i: _column(cells) for i, cells in enumerate(columns)})
    frame.columns = pd.Index(names)
    used = [i for i, name in enumerate(names) if name]
    lines = np.array([number for number, _ in samples], dtype=np.int64)
    return Table(file, frame.iloc[:, used], lines=lines)


def _column(cells: tuple[Any, ...]) -> Any:
    """The cells of a column: numbers, durations, or what stands there."""
    if all(cell is None or isinstance(cell, int | float) for cell in cells):
        return np.array([np.nan if cell is None else cell for cell in cells], dtype=float)
    moments = datetime.datetime | datetime.date | datetime.timedelta | datetime.time
    return pd.Series(
        [str(cell) if isinstance(cell, moments) else cell for cell in cells], dtype=object
    )
