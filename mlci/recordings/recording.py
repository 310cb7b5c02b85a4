"""A file's samples in the names and units of a system."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from mlci.recordings.table import Table
from mlci.spaces import Box, StateSpace

# What would break a line, or lead a terminal astray.
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")


@dataclass(frozen=True)
class Remark:
    """Something to tell about a file: what is wrong with it and what to do, or what was assumed."""

    file: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}: {self.message}"


@dataclass(frozen=True)
class Layout:
    """How the columns of files become a system's.

    Attributes:
        columns: name of a file's column by ours: a state, `time`, or `states` for an array of all.
        units: unit of a state in the files, by its name, where the files do not say it.
        time_unit: unit of time in the files; None takes what they say, or else seconds.
        dt: time between samples of files that do not tell it [s].
        keep: names of other columns that come along as they stand.
        derived: states that need not be there.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    time_unit: str | None = None
    dt: float = 0.01
    keep: Sequence[str] = ()
    derived: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Recording:
    """The samples of a file, not yet split into trials or checked.

    Attributes:
        table: what the file holds.
        frame: a row for each of the table's, by number. Columns of floats: `time` [s], each state
            that the file has, in the system's units; `control_1` to `control_m` and the goal's
            (`goal_columns`) where all of them are there; and what `Layout.keep` names, as it
            stands. NaN where the file has no number.
        time_resolution: what times are exact to [s].
        goal: of the whole file, or None.
        sample_columns: whether each sample is a column of the file, not a line.
        notes: what was assumed.
    """

    table: Table
    frame: pd.DataFrame
    time_resolution: float = 0.0
    goal: Box | None = None
    sample_columns: bool = False
    notes: tuple[str, ...] = ()

    def place(self, row: int, name: str = "") -> str:
        """Where a row of the frame stands in the file, for a message."""
        if self.sample_columns:
            lines, column = self.table.lines, f"column {row + 1}"
            of_state = list(self.frame.columns).index(name) - 1 if name in self.frame else -1
            at_line = of_state >= 0 and lines is not None
            return f"line {lines[of_state]}, {column}" if at_line else column  # type: ignore[index]
        return self.table.place(row)


def goal_columns(space: StateSpace) -> list[str]:
    """Names of the columns of a goal: its lower corner, then its upper."""
    return [f"goal_{end}_{name}" for end in ("lower", "upper") for name in space.names]


def shown_path(path: Path) -> str:
    """A path as text of one line that any stream and file takes."""
    text = str(path).encode("utf-8", "backslashreplace").decode("utf-8")
    return _CONTROL.sub(lambda odd: odd[0].encode("unicode_escape").decode(), text)
