"""numpy's archives, .npz: only the arrays that are used are loaded, and none beyond the limit."""

from __future__ import annotations

import zipfile
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from mlci.recordings.arrays import table_of_arrays
from mlci.recordings.table import Table, Unusable, Wants, refuse_large


def read(file: Path, wants: Wants, limit: int) -> Table:
    """An archive of arrays.

    Args:
        file: the archive.
        wants: which arrays to load.
        limit: bytes that they may take.

    Raises:
        Unusable: no archive, arrays that are damaged, or are not of numbers, or are too large.
    """
    with file.open("rb") as stream, zipfile.ZipFile(stream) as archive:
        names = [entry[:-4] for entry in archive.namelist() if entry.endswith(".npy")]
        used = {name: _header(archive, f"{name}.npy") for name in names if wants(name)}
        size = sum(prod(shape) * dtype.itemsize for shape, dtype in used.values())
        refuse_large(size, limit)
        arrays = {name: _array(archive, f"{name}.npy", used[name][0]) for name in used}
    return table_of_arrays(file, arrays, [name for name in names if name not in used])


def _header(archive: zipfile.ZipFile, entry: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array."""
    with archive.open(entry) as stream:
        version = npy.read_magic(stream)
        head = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = head(stream)
    if dtype.kind not in "biufmMUS":
        raise Unusable(f"array {entry!r} is of {dtype}, not of numbers")
    return shape, dtype


def _array(archive: zipfile.ZipFile, entry: str, shape: tuple[int, ...]) -> Any:
    """One array; its size has been checked."""
    with archive.open(entry) as stream:
        array = npy.read_array(stream, allow_pickle=False)
    if array.shape != shape:
        raise Unusable(f"array {entry!r} is not of the shape {shape} that it claims")
    return array
