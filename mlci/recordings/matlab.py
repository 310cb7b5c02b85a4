"""MATLAB's .mat files up to version 7: only the variables that are used are loaded."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from mlci.recordings.arrays import table_of_arrays
from mlci.recordings.table import Table, Unusable, Wants, refuse_large

_HDF5 = b"\x89HDF"
_COMPRESSED = 15  # type of a compressed element
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
    structs = [name for name, shape, kind in listed if kind == "struct" and prod(shape) == 1]
    inside = _inside(file, structs, limit) if structs else {}
    listed = [each for each in listed if each[0] not in structs]
    used = {name: (shape, kind) for name, shape, kind in listed if wants(name)}
    groups = [each for each in listed if each[2] in ("struct", "cell")]
    if groups and not (used or inside):
        name, shape, kind = groups[0]
        raise Unusable(f"variable {name!r} is a {kind} {shape}: save a file, or a struct, a trial")
    size = 8 * sum(prod(shape) for shape, _ in used.values())
    refuse_large(size, limit)
    for name, (_, kind) in used.items():
        if not kind.startswith(("double", "single", "int", "uint", "logical", "char")):
            raise Unusable(f"variable {name!r} is a {kind}, not an array of numbers")
    content = loadmat(str(file), variable_names=list(used))
    arrays = {name: content[name] for name in used}
    arrays |= {name: array for name, array in inside.items() if wants(name)}
    names = [*inside, *(name for name, *_ in listed)]
    return table_of_arrays(file, arrays, [name for name in names if name not in arrays])


def _inside(file: Path, structs: list[str], limit: int) -> dict[str, Any]:
    """The arrays of numbers and texts in structs, by names that dots join."""
    from scipy.io import loadmat

    _refuse_large(file, limit)
    content = loadmat(str(file), variable_names=structs, simplify_cells=True)

    def flat(tree: dict[str, Any], above: str) -> Iterator[tuple[str, Any]]:
        for name, value in tree.items():
            if isinstance(value, dict):
                yield from flat(value, f"{above}{name}.")
            elif np.asarray(value).dtype.kind in "biufU":
                yield f"{above}{name}", np.asarray(value)

    return dict(flat({name: content[name] for name in structs}, ""))


def _refuse_large(file: Path, limit: int) -> None:
    """Refuse a file that unpacks to more bytes than the limit."""
    size, most = 0, limit // 2  # beside the arrays themselves
    with file.open("rb") as stream:
        order = "<" if stream.read(_HEADER)[-2:] == b"IM" else ">"
        while len(tag := stream.read(8)) == 8 and size <= most:
            kind, length = struct.unpack(f"{order}II", tag)
            if kind == _COMPRESSED:
                unpacked = zlib.decompressobj().decompress(stream.read(length), most + 1)
                size += len(unpacked)
            else:
                size += length
                stream.seek(length, 1)
    if size > most:
        raise Unusable(f"unpacks to more than half of max_memory, {limit:.2g} bytes")
