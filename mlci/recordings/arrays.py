"""Named arrays, as archives hold them, to a table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mlci.recordings.columns import GOAL, STATES, TIMES, plain_name
from mlci.recordings.table import Table, Unusable

_FIXED = ("dt", *GOAL)


def table_of_arrays(file: Path, arrays: Mapping[str, Any], others: Sequence[str]) -> Table:
    """A table from arrays of one length; an array (R, d) named x becomes columns x[0] to x[d-1].

    Args:
        file: the file.
        arrays: what is used of it.
        others: names of what else it holds.

    Raises:
        Unusable: nothing to use, or arrays of different lengths.
    """
    columns, fixed = {}, {}
    values = {name: np.asarray(array) for name, array in arrays.items()}
    for name in list(values):
        if (ours := plain_name(name.rpartition(".")[2])) not in _FIXED:
            continue
        array = np.atleast_1d(values.pop(name).squeeze())
        if ours == "dt" and array.size != 1:
            raise Unusable(f"needs one number 'dt' [s], not {array.shape}")
        fixed[ours] = array.item() if ours == "dt" else array
    values = {name: _upright(array) for name, array in values.items() if array.ndim}
    rows = _rows(values) if values else 0
    for name, array in values.items():
        if array.ndim > 2:
            raise Unusable(f"array {name!r} has {array.ndim} dimensions {array.shape}: 1 or 2")
        if array.ndim == 2 and array.shape[1] == rows != array.shape[0]:
            array = array.T
        if plain_name(name).startswith("control") and array.shape[0] != rows:
            if array.shape[0] != rows - 1:
                continue  # controls are never needed
            array = np.concatenate([array, np.full_like(array[:1], np.nan, dtype=float)])
        if array.shape[0] != rows:
            raise Unusable(f"needs {name!r} of shape ({rows},), not {array.shape}")
        if array.ndim == 1:
            columns[name] = array
        else:
            columns |= {f"{name}[{d}]": column for d, column in enumerate(array.T)}
    return Table(file, pd.DataFrame(columns), fixed=fixed, others=others)


def _upright(array: Any) -> Any:
    """A vector that is stored as a matrix, as MATLAB does."""
    is_vector = array.ndim == 2 and 1 in array.shape and array.size > 1
    return array.ravel() if is_vector else array


def _rows(arrays: Mapping[str, Any]) -> int:
    """How many samples there are: as many as times, or else as the longest sides of most arrays."""
    for name, array in arrays.items():
        if plain_name(name) in TIMES and array.ndim == 1:
            return len(array)
    if (states := arrays.get(STATES)) is not None:
        return len(states)
    return Counter(max(array.shape) for array in arrays.values()).most_common(1)[0][0]
