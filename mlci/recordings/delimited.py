"""Text of numbers: .csv, .tsv, .txt, with any delimiter, decimal sign and encoding mark.

The first line that is no comment names the columns, unless it begins with a number. A comment
begins with # or %; the last one before the numbers names the columns if it has as many entries.
Lines above the names that have fewer entries are left out; a line below them may hold units.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mlci.recordings.table import NoRecording, Table, Unusable, Wants

_DELIMITERS = ("\t", ";", "|", ",")
SPACES = r"\s+"
_LONG_LINE, _LONG_ENTRY = 10_000, 1000  # characters; numbers that are longer take very long
_MOST_COLUMNS, _WIDE = 100_000, 1000  # a wide table is slow to read by column
_LONG_UNIT = 20  # characters
_FEW_ROWS = 0.1  # of the number of columns: a table of numbers with fewer rows is slow likewise
_SEEN = 50  # lines by which delimiter and decimal sign are known
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_INNER = "\x1f"  # a delimiter that no text holds
# What people and programs write where there is no number, beside what pandas knows.
_NO_NUMBER = ("-", "--", "---", ".", "?", "*", "NAN", "na", "1.#QNAN", "-1.#QNAN", "1.#IND",
              "-1.#IND", "#DIV/0!", "#VALUE!", "#REF!", "#NUM!")  # fmt: skip
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")

_NO_THOUSAND = re.compile(r"\s*[+-]?(0?,\d+|\d+,(\d\d?|\d{4,}))([eE][+-]?\d+)?\s*")


def read(file: Path, wants: Wants, _limit: int) -> Table:
    """A file of delimited text.

    Raises:
        NoRecording: a .txt file without samples.
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
    delimiter, usual = _delimiter([lines[i] for i in full[:_SEEN]])
    delimiter = sign[1] if sign else delimiter
    if file.suffix.lower() == ".txt" and _is_prose([lines[i] for i in full], delimiter, wants):
        raise NoRecording("is text without samples")
    del full[: _preamble([lines[i] for i in full[:_SEEN]], delimiter, usual)]
    width = _count(lines[full[0]], delimiter)
    if width > _MOST_COLUMNS:
        raise Unusable(f"line {full[0] + 1} has {width} values: {_MOST_COLUMNS} are the most")
    first, header, units = split(lines[full[0]], delimiter), None, dict[str, str]()
    if not _is_number(first[0]):
        header, full = first, full[1:]
        entries = _count(lines[full[0]], delimiter) if full else len(header)
        while len(header) > entries and not header[-1].strip():
            del header[-1]  # nothing follows the last delimiter
        if units := _units(header, [split(lines[i], delimiter) for i in full[:2]]):
            del full[0]
    elif above := [i for i in comments if i < full[0]]:
        names = split(lines[above[-1]].strip().lstrip("# \t"), delimiter)
        header = names if len(names) == len(first) and not _is_number(names[0]) else None
    named = header is not None
    table = table_of_lines(file, lines, full, header or len(first), delimiter, named)
    return replace(table, units=units)


def _preamble(lines: Sequence[str], delimiter: str, usual: int) -> int:
    """How many lines with other things precede the names: with fewer entries, and no numbers."""
    for number, line in enumerate(lines):
        entries = split(line, delimiter)
        if len(entries) == usual and not any(map(_is_number, entries)):
            return number
        if len(entries) >= usual or _is_number(entries[0]):
            break
    return 0


def _is_prose(lines: Sequence[str], delimiter: str, wants: Wants) -> bool:
    """Whether no line begins with two numbers, and the first names no column that is used."""
    samples = (split(line, delimiter)[:2] for line in lines)
    return not (
        any(len(entries) == 2 and all(map(_is_number, entries)) for entries in samples)
        or any(map(wants, split(lines[0], delimiter)))
    )


def _units(header: Sequence[str], rows: Sequence[Sequence[str]]) -> dict[str, str]:
    """The units in the line below the names, by these; empty if it is another line of samples."""
    if len(rows) < 2 or len(rows[0]) > len(header) or any(map(_is_number, rows[0])):
        return {}
    pairs = zip(header, rows[0], rows[1], strict=False)
    units = {name.strip(): text.strip(' []()"') for name, text, below in pairs if _is_number(below)}
    if any(len(unit) > _LONG_UNIT or unit in ("NA", *_NO_NUMBER) for unit in units.values()):
        return {}
    return {name: unit for name, unit in units.items() if unit}


def text_lines(file: Path) -> list[str]:
    """The lines of a text file, without encoding mark and line ends.

    Raises:
        Unusable: bytes that are no text.
    """
    content = file.read_bytes()
    plain = {(False, True): "utf-16-le", (True, False): "utf-16-be"}.get(
        (content[:1] == b"\0", content[1:2] == b"\0"), "utf-8"
    )
    encoding = next((name for mark, name in _MARKS if content.startswith(mark)), plain)
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
    comma = any(map(_DECIMAL_COMMA.fullmatch, seen))
    if delimiter == ",":  # between quotes, where "1,000" may be a thousand
        comma = any(map(_NO_THOUSAND.fullmatch, seen)) and not any("." in entry for entry in seen)
    if comma and delimiter == ",":
        texts, delimiter = [_INNER.join(split(text, ",")) for text in texts], _INNER
    if len(names) > _WIDE or len(rows) < _FEW_ROWS * len(names):
        frame = _by_row(texts, delimiter, comma)
    else:
        frame = pd.DataFrame()
    if len(names) <= _WIDE and (frame.empty or any(it.kind == "O" for it in frame.dtypes)):
        frame = _by_column(texts, delimiter, comma, len(names))
    if len(frame) != len(rows):
        raise Unusable(f"has {len(rows)} lines of samples, but {len(frame)} rows: quotes?")
    frame.columns = pd.Index(
        [name.strip() or _unnamed(frame.iloc[:, i], i) for i, name in enumerate(names)]
    )
    return Table(file, frame, lines=np.array(rows, dtype=np.int64) + 1, header=named)


def _unnamed(column: pd.Series[Any], number: int) -> str:
    """A name for a column without one; "" for one that is empty or numbers the lines."""
    if column.isna().all() or (column.dtype.kind == "i" and np.all(np.diff(column) == 1)):
        return ""
    return f"column {number + 1}"


def _by_row(texts: Sequence[str], delimiter: str, comma: bool) -> pd.DataFrame:
    """A table of many columns."""
    rows = []
    for text in texts:
        row = pd.Series(split(text.replace(",", ".") if comma else text, delimiter), dtype=object)
        row = row.mask(row.str.strip().isin(("", "NA", *_NO_NUMBER)))
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
            na_values=_NO_NUMBER,
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
    """A line that must have so many entries; delimiters may follow the last."""
    count = _count(line, delimiter)
    if delimiter == SPACES:
        line = line.strip()
    elif count > width:
        bare = line.rstrip(f" {delimiter}")
        after = line[len(bare) :].count(delimiter)
        needless = min(after, count - width)
        line, count = bare + delimiter * (after - needless), count - needless
    if len(line) > _LONG_LINE and max(map(len, split(line, delimiter))) > _LONG_ENTRY:
        raise Unusable(f"line {number + 1} has an entry of more than {_LONG_ENTRY} characters")
    if count != width:
        before = "the header" if named else f"line {rows[0] + 1}"
        raise Unusable(f"line {number + 1} has {count} values where {before} has {width}")
    return line


def _delimiter(lines: Sequence[str]) -> tuple[str, int]:
    """What cuts most of these lines into the same number of entries, at least two; and how many."""
    best, most, score = ",", 1, 0.0
    for delimiter in (*_DELIMITERS, SPACES):
        counts = [_count(line, delimiter) for line in lines]
        usual = max(set(counts), key=counts.count)
        share = counts.count(usual) / len(lines)
        if usual > 1 and share > score:
            best, most, score = delimiter, usual, share
    return best, most


def _is_number(text: str) -> bool:
    """Whether a text is a number, with a decimal comma or point."""
    try:
        float(text.strip().strip('"').replace(",", "."))
    except ValueError:
        return False
    return True
