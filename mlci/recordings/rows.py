"""Tables of text whose entries are names: rows of a file, by the columns that are asked for."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mlci.recordings.columns import plain_name, position
from mlci.recordings.delimited import text_lines
from mlci.recordings.table import Unusable

_DELIMITERS = ("\t", ";", "|", ",")


@dataclass(frozen=True)
class Rows:
    """Some columns of a file.

    Attributes:
        columns: the R entries of each column by its name; only columns that the file has.
        lines: (R,) line of the file in which each row stands.
    """

    columns: Mapping[str, Sequence[str]]
    lines: Sequence[int]


def read_rows(file: Path, needed: Sequence[str], others: Sequence[str] = ()) -> Rows:
    """The rows below a line of names; comments begin with #, empty lines are passed over.

    Args:
        file: of text, with tabs, semicolons, bars or commas between entries.
        needed: names of columns that the file must have; case and spaces make no difference.
        others: names of columns that it may have.

    Raises:
        Unusable: no file, no text, a header without the needed names, a name that stands twice, or
            a row of another length.
    """
    try:
        if file.exists() and not file.is_file():
            raise Unusable("is not a file")
        lines = text_lines(file)
    except FileNotFoundError:
        raise Unusable("there is no such file") from None
    except (OSError, ValueError) as error:
        if isinstance(error, Unusable):
            raise
        reason = getattr(error, "strerror", None) or error  # such as a zero byte in the name
        raise Unusable(f"cannot be read ({reason})") from None
    full = [i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")]
    if not full:
        raise Unusable("is empty")
    head = lines[full[0]]
    delimiter = next((sign for sign in _DELIMITERS if sign in head), ",")
    content = (lines[i] for i in full)
    try:
        rows = list(csv.reader(content, delimiter=delimiter, skipinitialspace=True))
    except csv.Error as error:
        raise Unusable(f"cannot be taken apart ({error}); does it hold a single quote?") from None
    if len(rows) != len(full):
        raise Unusable("has a quote that goes on to the next line")
    header = rows[0]
    for i, row in zip(full[1:], rows[1:], strict=True):
        if len(row) != len(header):
            raise Unusable(f"line {i + 1} has {len(row)} values where the header has {len(header)}")
    places = {name: position(name, header) for name in (*needed, *others)}
    if missing := [name for name in needed if places[name] is None]:
        raise Unusable(
            f"line {full[0] + 1} must name the columns {', '.join(needed)}; "
            f"{' and '.join(missing)} is not among {', '.join(map(repr, header))}"
        )
    columns = {
        name: [row[place].strip() for row in rows[1:]]
        for name, place in places.items()
        if place is not None
    }
    return Rows(columns, [i + 1 for i in full[1:]])


def number_of(names: Sequence[str], what: str) -> dict[str, int]:
    """The number of each name, however it is spelt; of a number also as 4.0 or 04.

    Raises:
        ValueError: a name that stands twice.
    """
    numbers = {canonical(name): i for i, name in enumerate(names)}
    if len(numbers) < len(names):
        twice = next(name for i, name in enumerate(names) if numbers[canonical(name)] != i)
        raise ValueError(f"{what} must have different names, and {twice!r} stands twice")
    return numbers


def canonical(name: str) -> str:
    """A name without case and spaces; a whole number without zeros before or behind it."""
    try:
        value = float(name)
    except ValueError:
        return plain_name(name)
    return str(int(value)) if value.is_integer() else name.strip()
