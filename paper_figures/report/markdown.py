"""Pieces of Markdown: numbers with intervals, tables, figures."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import pandas as pd

_FIGURE = (
    r"Figure \d+\]\((?:\.\./[\w-]+/)?figures/[\w.-]+\)"  # as `figure` writes it, without its ![
)


def number(value: float, digits: int = 3) -> str:
    """A number with some significant digits; a dash where there is none."""
    if pd.isna(value):
        return "-"
    if abs(value) < 5e-4 or abs(value) >= 10**digits:
        return f"{value:.0f}"
    return f"{value:#.{digits}g}".rstrip(".")


def count(value: float) -> str:
    """A rank or a count, which may be a half."""
    return "-" if pd.isna(value) else f"{value:g}"


def percent(value: float) -> str:
    """A share in percent."""
    return "-" if pd.isna(value) else f"{100 * value:.0f} %"


def between(value: str, low: str, high: str) -> str:
    """A value with its interval in brackets."""
    return value if "-" in (low, high) else f"{value} [{low.removesuffix(' %')}, {high}]"


def table(head: Sequence[str], rows: Iterable[Sequence[object]], words: int = 1) -> str:
    """A table whose first columns, `words` of them, hold words, and the others numbers."""
    lines = [head, ["---"] * words + ["---:"] * (len(head) - words), *rows]
    return "".join(f"| {' | '.join(map(_cell, line))} |\n" for line in lines)


def without_markup(text: str) -> str:
    """A text of pieces whose words may be of somebody's files: no HTML, and no picture but figures.

    Not every program that shows Markdown leaves these out.
    """
    text = re.sub(r"<(?=[A-Za-z/!?])", "&lt;", text)
    return re.sub(rf"!\[(?!{_FIGURE}$)", r"!\[", text, flags=re.MULTILINE)


def by_dt(rows: pd.DataFrame, column: str) -> str:
    """A line for each truth and number of cells, a column for each time step.

    Args:
        rows: truth, cells, dt, and a text for each.
        column: the name of the text.
    """
    steps = sorted(rows["dt"].unique())
    texts = {(r.truth, r.cells, r.dt): getattr(r, column) for r in rows.itertuples()}
    lines = sorted({(truth, cells) for truth, cells, _ in texts})
    return table(
        ["truth, cells", *(f"dt {dt:g} s" for dt in steps)],
        [
            [f"{truth.upper()}, {cells}", *(texts.get((truth, cells, dt), "") for dt in steps)]
            for truth, cells in lines
        ],
    )


def _cell(value: object) -> str:
    """A cell, which ends no line and no column."""
    return re.sub(r"(?<!\\)\|", r"\|", " ".join(str(value).splitlines()))


def figure(path: str, number: int, caption: str) -> str:
    """A figure with its number and caption; the path is relative to the report."""
    return f"![Figure {number}]({path})\n\n*Figure {number}: {caption}*\n"


def contents(headings: Iterable[str]) -> str:
    """Links to headings, as a list."""
    return "".join(f"- [{heading}](#{anchor(heading)})\n" for heading in headings)


def anchor(heading: str) -> str:
    """What a link to a heading names, as GitHub makes it from the heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
