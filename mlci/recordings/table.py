"""What a file holds, before anybody says what it means."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from mlci.spaces import Ints

Wants = Callable[[str], bool]  # whether an array or column of this name is used at all


class Unusable(ValueError):
    """Why a file cannot be used, and what to do."""


class NoRecording(Unusable):
    """What a file is that nobody takes for a recording, such as a text or metadata."""


def refuse_large(size: float, limit: int, verb: str = "claims") -> None:
    """Refuse what would take more memory than it may, before it is loaded.

    Args:
        size: of what is to be loaded [bytes].
        limit: bytes that reading may take.
        verb: how sure the size is.

    Raises:
        Unusable: a size above the limit.
    """
    if size > limit:
        raise Unusable(f"{verb} {size:.2g} bytes, more than the {limit:.2g} of max_memory")


@dataclass(frozen=True, eq=False)
class Table:
    """The rows of a file, as they stand there.

    Attributes:
        path: the file.
        columns: R rows; each column is of numbers, timestamps, durations or text. Names may repeat.
        units: unit of a column as the file states it, by the column's name.
        lines: (R,) line of the file in which each row stands; None where it has no lines.
        fixed: what holds for all rows: `dt` [s], `goal_lower` and `goal_upper` (n,), `in_degrees`.
        others: names of what the file holds beside, and nobody uses.
        header: whether the file names its columns.

    Raises:
        ValueError: not a line for each row.
    """

    path: Path
    columns: pd.DataFrame
    units: Mapping[str, str] = field(default_factory=dict)
    lines: Ints | None = None
    fixed: Mapping[str, Any] = field(default_factory=dict)
    others: Sequence[str] = ()
    header: bool = True

    def __post_init__(self) -> None:
        if self.lines is not None and len(self.lines) != len(self.columns):
            raise ValueError(f"{len(self.columns)} rows need as many lines, not {len(self.lines)}")

    def place(self, row: int) -> str:
        """Where a row stands, for a message."""
        return f"sample {row}" if self.lines is None else f"line {self.lines[row]}"
