"""OpenSim's text files: .mot and .sto tables, and .trc markers.

A .mot or .sto file begins with `name=value` lines up to `endheader`, then a line of names. With
`inDegrees=yes` its angles are in degrees. A .trc file has three lines of its own, then names of
markers, whose coordinates become columns `NAME x`, `NAME y` and `NAME z`.
"""

from __future__ import annotations

import re
from pathlib import Path

from mlci.recordings.delimited import SPACES, table_of_lines, text_lines
from mlci.recordings.table import Table, Unusable, Wants

_TRC_NAMES = 3  # the line of markers' names, from 0


def read_motion(file: Path, _wants: Wants, _limit: int) -> Table:
    """A .mot or .sto file.

    Raises:
        Unusable: no `endheader`, or nothing after it.
    """
    lines = text_lines(file)
    ends = [i for i, line in enumerate(lines) if line.strip().lower() == "endheader"]
    if not ends:
        raise Unusable("has no line 'endheader' before its columns")
    full = [i for i in range(ends[0] + 1, len(lines)) if lines[i].strip()]
    if not full:
        raise Unusable("has nothing after its line 'endheader'")
    head = "\n".join(lines[: ends[0]])
    degrees = re.search(r"^\s*inDegrees\s*=\s*(yes|true|1)\s*$", head, re.MULTILINE | re.IGNORECASE)
    delimiter = "\t" if "\t" in lines[full[0]].strip() else SPACES
    header = lines[full[0]].strip().split(None if delimiter == SPACES else delimiter)
    table = table_of_lines(file, lines, full[1:], header, delimiter)
    return Table(file, table.columns, lines=table.lines, fixed={"in_degrees": degrees is not None})


def read_markers(file: Path, _wants: Wants, _limit: int) -> Table:
    """A .trc file.

    Raises:
        Unusable: it does not begin as one, or its names do not fit.
    """
    lines = text_lines(file)
    if not lines[0].startswith("PathFileType") or len(lines) <= _TRC_NAMES + 1:
        raise Unusable("does not begin with the lines of a .trc file (PathFileType ...)")
    about = dict(zip(lines[1].split(), lines[2].split(), strict=False))
    names = lines[_TRC_NAMES].rstrip().split("\t")
    if [name.strip().lower() for name in names[:2]] != ["frame#", "time"]:
        raise Unusable(f"line {_TRC_NAMES + 1}: must begin with Frame# and Time, between tabs")
    header = ["frame", "time"]
    for marker in filter(None, (name.strip() for name in names[2:])):
        header += [f"{marker} {axis}" for axis in "xyz"]
    rows = [i for i in range(_TRC_NAMES + 2, len(lines)) if lines[i].strip()]
    table = table_of_lines(file, lines, rows, header, "\t")
    units = {name: about["Units"] for name in header[2:]} if "Units" in about else {}
    return Table(file, table.columns, units, table.lines)
