"""Text that fits a terminal: entries beside their titles, and tables; light to import."""

from __future__ import annotations

import os
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import TextIO

WIDTH = 80  # columns of a terminal


def counted(count: int, noun: str) -> str:
    """A number of things: 1 point, 2 points."""
    return f"{count} {noun}{'s' * (count != 1)}"


def words(name: str) -> str:
    """A column's or dimension's name as a reader would write it."""
    return name.replace("_", " ")


def entry(title: str, text: str, hang: int = 0) -> list[str]:
    """A text beside its title, in lines that break between words."""
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=f"{title:15} ",
        subsequent_indent=" " * (16 + hang),
        break_long_words=False,
        break_on_hyphens=False,
    )


def fitted(text: str, stream: TextIO) -> str:
    """A text as it is, or, for a terminal, with lines that break between words."""
    if not stream.isatty():
        return text
    return "\n".join(
        part
        for line in text.splitlines()
        for part in textwrap.wrap(
            line,
            shutil.get_terminal_size().columns,
            subsequent_indent="  ",
            break_long_words=False,
            break_on_hyphens=False,
            drop_whitespace=True,
            replace_whitespace=False,
        )
        or [""]
    )


def complain(text: str) -> None:
    """Print what is wrong."""
    print(fitted(text, sys.stderr), file=sys.stderr)


def say(lines: Iterable[str]) -> None:
    """Print what is known before the work, which goes on where nobody reads."""
    try:
        for line in lines:
            print(line)
        sys.stdout.flush()
    except BrokenPipeError:
        print_nowhere()


def print_nowhere() -> None:
    """Drop what is printed from now on, as nobody reads it or there is no room for it."""
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


def terminal_width() -> int | None:
    """Columns of the terminal that is printed to; None where there is none."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def table_lines(rows: Sequence[Sequence[object]], width: int | None = None) -> Iterator[str]:
    """Rows, the first of them the head, in aligned columns.

    Args:
        rows: equally many cells each; numbers are set to the right.
        width: of the terminal; columns that do not fit are left out and counted. None takes any.
    """
    texts = [[_cell(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    fitting = len(widths)
    while width is not None and fitting > 1 and sum(widths[:fitting]) + 2 * (fitting - 1) > width:
        fitting -= 1
    right = [
        all(isinstance(cell, int | float | None) for cell in column)
        for column in zip(*rows[1:], strict=True)
    ] or [False] * len(widths)
    for row in texts:
        cells = [
            text.rjust(size) if to_right else text.ljust(size)
            for text, size, to_right in zip(row[:fitting], widths, right, strict=False)
        ]
        yield "  ".join(cells).rstrip()
    if fitting < len(widths):
        yield f"({', '.join(texts[0][fitting:])}: not shown, the terminal is too narrow)"


def _cell(value: object) -> str:
    """A value in a table for people."""
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def job_names(jobs: Sequence[Sequence[str]]) -> list[str]:
    """What tells each job from the others, as a person would type it."""
    shared = set(jobs[0]).intersection(*jobs) if len(jobs) > 1 else set()
    names = [" ".join(part for part in job if part not in shared) for job in jobs]
    return [name.replace("'", "") or "defaults" for name in names]
