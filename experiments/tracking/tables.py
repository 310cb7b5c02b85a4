"""Numbers in tables: ten digits, and whether two tables agree but for rounding.

The same code on another processor gives numbers that differ in their last digits. So tables carry
ten significant digits, and a table on disk that a new one agrees with stays as it is.
"""

from __future__ import annotations

import io
import re

import numpy as np
import numpy.typing as npt
import pandas as pd

DIGITS = 10  # significant digits of a number in a table
AGREEMENT = 1e-8  # by how much numbers of two tables that agree may differ
_NOTHING = 1e-12  # differences below are rounding, whatever else is in the column

_WHOLE = re.compile(r"[+-]?\d+")


def rounded(frame: pd.DataFrame) -> pd.DataFrame:
    """A table with `DIGITS` significant digits of each float."""
    floats = [name for name in frame.columns if frame[name].dtype.kind == "f"]
    return frame.assign(
        **{name: [float(f"{v:.{DIGITS}g}") for v in frame[name].tolist()] for name in floats}
    )


def agree(before: bytes, after: bytes) -> bool:
    """Whether two tables (CSV) say the same.

    They have the same rows and columns. Cells are spelt alike, or hold numbers a and b, not both of
    them whole, with |a - b| <= AGREEMENT max(|a|, |b|, s), where s is the largest number of the
    column, but at most 1: what is small beside the others of its column may be rounding alone. So
    may all of a column be that is below 1e-12.
    """
    if before == after:
        return True
    try:
        old, new = (_cells(data) for data in (before, after))
    except (ValueError, pd.errors.ParserError):
        return False
    if old.shape != new.shape:
        return False
    return all(
        _columns_agree(old[:, column], new[:, column])
        for column in np.flatnonzero(np.any(old != new, axis=0))
    )


def _cells(data: bytes) -> npt.NDArray[np.object_]:
    """(rows, columns) cells of a table as text, its header the first row."""
    table = pd.read_csv(io.BytesIO(data), header=None, dtype=object, keep_default_na=False)
    return table.to_numpy()


def _columns_agree(old: npt.NDArray[np.object_], new: npt.NDArray[np.object_]) -> bool:
    """Whether the cells (rows,) of a column agree."""
    which = old != new
    for a, b in zip(old[which], new[which], strict=True):
        if _WHOLE.fullmatch(a) and _WHOLE.fullmatch(b):
            return False
    try:
        one, other = old[which].astype(float), new[which].astype(float)
    except ValueError:
        return False
    of_column = np.abs(np.asarray(pd.to_numeric(pd.Series(old), errors="coerce"), dtype=float))
    scale = min(1.0, float(np.max(of_column, where=np.isfinite(of_column), initial=0.0)))
    with np.errstate(invalid="ignore"):  # infinite ones
        largest = np.maximum(np.maximum(np.abs(one), np.abs(other)), scale)
        allowed = np.maximum(AGREEMENT * largest, _NOTHING)
        return bool(np.all(np.isfinite(largest) & (np.abs(one - other) <= allowed)))
