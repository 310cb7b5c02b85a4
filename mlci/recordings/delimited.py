"""Text of numbers: .csv, .tsv, .txt, with any delimiter, decimal sign and encoding mark.

The first line that is no comment names the columns, unless it begins with a number. A comment
begins with # or %; the last one before the numbers names the columns if it has as many entries.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from mlci.recordings.table import Table, Unusable, Wants

_DELIMITERS = ("\t", ";", "|", ",")
SPACES = r"\s+"
_LONG_LINE, _LONG_ENTRY = 10_000, 1000  # characters; numbers that are longer take very long
_MOST_COLUMNS, _WIDE = 100_000, 1000  # a wide table is slow to read by column
_SEEN = 50  # lines by which delimiter and decimal sign are known
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")


def read(file: Path, _wants: Wants, _limit: int) -> Table:
    """A file of delimited text.

    Raises:
        Unusable: no text, nothing in it, or lines of different lengths.
    """
    lines = text_lines(file)
    comments = [i for i, line in enumerate(lines) if line.lstrip()[:1] in ("#", "%")]
    marked = set(comments)
    full = [i for i, line in enumerate(lines) if i not in marked and line.strip()]
    if full and (sign := re.fullmatch(r"sep=(.)", lines[full[0]].strip())):  # of Excel
        del full[0]
    else:
        sign = None
    if not full:
        raise Unusable("is empty")
    delimiter = sign[1] if sign else _delimiter([lines[i] for i in full[:_SEEN]])
    width = _count(lines[full[0]], delimiter)
    if width > _MOST_COLUMNS:
        raise Unusable(f"line {full[0] + 1} has {width} values: {_MOST_COLUMNS} are the most")
    first, header = split(lines[full[0]], delimiter), None
    if not _is_number(first[0]):
        header, full = first, full[1:]
    elif above := [i for i in comments if i < full[0]]:
        names = split(lines[above[-1]].strip().lstrip("# \t"), delimiter)
        header = names if len(names) == len(first) and not _is_number(names[0]) else None
    return table_of_lines(file, lines, full, header or len(first), delimiter, header is not None)


def text_lines(file: Path) -> list[str]:
    """The lines of a text file, without encoding mark and line ends.

    Raises:
        Unusable: bytes that are no text.
    """
    content = file.read_bytes()
    encoding = next((name for mark, name in _MARKS if content.startswith(mark)), "utf-8")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    del content
    if odd := re.search(r"[\x00-\x08\x0e-\x1f\ufffe\uffff]", text):
        line = text.count("\n", 0, odd.start()) + 1
        raise Unusable(f"line {line}: is not text (character {ord(odd[0])})")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def table_of_lines(
    file: Path,
    lines: Sequence[str],
    rows: Sequence[int],
    header: Sequence[str] | int,
    delimiter: str,
    named: bool = True,
) -> Table:
    """A table from lines of text.

    Args:
        file: the file.
        lines: all its lines.
        rows: numbers of the lines, from 0, that hold samples.
        header: names of the columns, or how many there are.
        delimiter: between entries.
        named: whether `header` comes from the file.

    Raises:
        Unusable: lines of different lengths.
    """
    names = [f"column {i + 1}" for i in range(header)] if isinstance(header, int) else list(header)
    texts = [_of_width(lines[i], delimiter, len(names), i, rows, named) for i in rows]
    seen = [entry for text in texts[:_SEEN] for entry in split(text, delimiter)[:_WIDE]]
    comma = delimiter != "," and any(map(_DECIMAL_COMMA.fullmatch, seen))
    if len(names) > _WIDE:
        frame = _by_row(texts, delimiter, comma)
    else:
        frame = _by_column(texts, delimiter, comma, len(names))
    if len(frame) != len(rows):
        raise Unusable(f"has {len(rows)} lines of samples, but {len(frame)} rows: quotes?")
    frame.columns = pd.Index([name.strip() for name in names])
    return Table(file, frame, lines=np.array(rows, dtype=np.int64) + 1, header=named)


def _by_row(texts: Sequence[str], delimiter: str, comma: bool) -> pd.DataFrame:
    """A table of many columns."""
    rows = []
    for text in texts:
        row = pd.Series(split(text.replace(",", ".") if comma else text, delimiter), dtype=object)
        try:
            rows.append(pd.to_numeric(row).to_numpy())
        except ValueError:
            rows.append(row.to_numpy())
    return pd.DataFrame(np.vstack(rows)) if rows else pd.DataFrame()


def _by_column(texts: Sequence[str], delimiter: str, comma: bool, width: int) -> pd.DataFrame:
    """A table of few columns."""
    try:
        return pd.read_csv(
            io.StringIO("\n".join(texts)),
            sep=delimiter,
            header=None,
            names=range(width),
            index_col=False,
            decimal="," if comma else ".",
            skipinitialspace=True,
            low_memory=False,
        )
    except pd.errors.EmptyDataError:
        return pd.DataFrame({i: np.empty(0) for i in range(width)})


def split(line: str, delimiter: str) -> list[str]:
    """The entries of a line."""
    if delimiter == SPACES:
        return line.split()
    if '"' not in line:
        return line.split(delimiter)
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [""])


def _count(line: str, delimiter: str) -> int:
    """How many entries a line has."""
    if delimiter != SPACES and '"' not in line:
        return line.count(delimiter) + 1
    return len(split(line, delimiter))


def _of_width(
    line: str, delimiter: str, width: int, number: int, rows: Sequence[int], named: bool
) -> str:
    """A line that must have so many entries; one delimiter may follow the last."""
    count = _count(line, delimiter)
    if delimiter == SPACES:
        line = line.strip()
    elif count == width + 1 and line.rstrip(" ").endswith(delimiter):
        line, count = line.rstrip(" ")[:-1], width
    if len(line) > _LONG_LINE and max(map(len, split(line, delimiter))) > _LONG_ENTRY:
        raise Unusable(f"line {number + 1} has an entry of more than {_LONG_ENTRY} characters")
    if count != width:
        before = "the header" if named else f"line {rows[0] + 1}"
        raise Unusable(f"line {number + 1} has {count} values where {before} has {width}")
    return line


def _delimiter(lines: Sequence[str]) -> str:
    """What cuts most of these lines into the same number of entries, at least two."""
    best, score = ",", 0.0
    for delimiter in (*_DELIMITERS, SPACES):
        counts = [_count(line, delimiter) for line in lines]
        usual = max(set(counts), key=counts.count)
        share = counts.count(usual) / len(lines)
        if usual > 1 and share > score:
            best, score = delimiter, share
    return best


def _is_number(text: str) -> bool:
    """Whether a text is a number, with a decimal comma or point."""
    try:
        float(text.strip().strip('"').replace(",", "."))
    except ValueError:
        return False
    return True
