"""MATLAB's .mat files up to version 7: only the variables that are used are loaded."""

from __future__ import annotations

from math import prod
from pathlib import Path

from mlci.recordings.arrays import table_of_arrays
from mlci.recordings.table import Table, Unusable, Wants

_HDF5 = b"\x89HDF"
_HEADER = 128  # bytes of text and version at the start


def read(file: Path, wants: Wants, limit: int) -> Table:
    """A .mat file.

    Args:
        file: the file.
        wants: which variables to load.
        limit: bytes that they may take.

    Raises:
        Unusable: a file of version 7.3, or variables that are no numbers, or too large.
    """
    from scipy.io import loadmat, whosmat

    with file.open("rb") as stream:
        head = stream.read(_HEADER + 512)
    if _HDF5 in head or b"MATLAB 7.3" in head:
        raise Unusable("is of MATLAB's version 7.3: save it again by save(..., '-v7')")
    listed = whosmat(str(file))
    used = {name: (shape, kind) for name, shape, kind in listed if wants(name)}
    size = 8 * sum(prod(shape) for shape, _ in used.values())
    if size > limit:
        raise Unusable(f"claims {size:.2g} bytes, more than the {limit:.2g} of max_memory")
    for name, (_, kind) in used.items():
        if not kind.startswith(("double", "single", "int", "uint", "logical", "char")):
            raise Unusable(f"variable {name!r} is a {kind}, not an array of numbers")
    content = loadmat(str(file), variable_names=list(used))
    arrays = {name: content[name] for name in used}
    return table_of_arrays(file, arrays, [name for name, *_ in listed if name not in used])
