"""Starts and goals of trials from a table, where the ends of the paths do not tell them."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from mlci.recordings.columns import shortened
from mlci.recordings.recording import goal_columns
from mlci.spaces import Box, Floats, StateSpace

TRIAL = "trial"


@dataclass(frozen=True, eq=False)
class Ends:
    """What a table says of a trial; None where it leaves that to the path.

    Attributes:
        start: (n,) first state of the task.
        goal: region of the last.
    """

    start: Floats | None
    goal: Box | None


def read_task_table(file: str | Path, space: StateSpace) -> dict[str, Ends]:
    """Start and goal of each trial by its name.

    Args:
        file: of text, any delimiter; columns `trial`, and `start_NAME` of each dimension, or
            `goal_lower_NAME` and `goal_upper_NAME` of each, or all. Goals that are free in a
            dimension are -inf to inf there.
        space: names the dimensions.

    Raises:
        ValueError: a file that is no such table, or that names a trial twice.
        OSError: a file that cannot be read.
    """
    if Path(file).exists() and not Path(file).is_file():
        raise ValueError(f"{file}: is not a file")
    try:
        table = pd.read_csv(
            file, sep=None, engine="python", dtype={TRIAL: str}, encoding="utf-8-sig"
        )
    except (
        csv.Error,
        pd.errors.ParserError,
        pd.errors.EmptyDataError,
        UnicodeDecodeError,
    ) as error:
        raise ValueError(f"{file}: is no table ({' '.join(str(error).split())})") from None
    starts, goals = [f"start_{name}" for name in space.names], goal_columns(space)
    groups = [group for group in (starts, goals) if set(group) <= set(table.columns)]
    if TRIAL not in table or not groups:
        raise ValueError(
            f"{file}: needs a column {TRIAL}, and {', '.join(starts)}, or {', '.join(goals)}, or "
            f"all of them; it has {', '.join(map(str, table.columns))}"
        )
    ends: dict[str, Ends] = {}
    for row, name in enumerate(table[TRIAL].astype(str).str.strip()):
        if name in ends:
            raise ValueError(f"{file}: has trial {name!r} twice")
        numbers = [
            _numbers(file, name, table[group].iloc[row])
            for group in (starts, goals)
            if group in groups
        ]
        start = numbers[0] if starts in groups else None
        goal = None
        if goals in groups:
            lower, upper = numbers[-1].reshape(2, -1)
            if np.any(lower > upper) or np.any(np.isfinite(lower) != np.isfinite(upper)):
                raise ValueError(
                    f"{file}: trial {name!r} has a goal that is no box: {lower.tolist()} to "
                    f"{upper.tolist()}"
                )
            goal = Box(lower, upper)
        ends[name] = Ends(start, goal)
    return ends


def unmatched(table: Mapping[str, Ends], trials: Iterable[str]) -> list[str]:
    """A phrase each for trials that the table lacks and rows that belong to no trial."""
    names = list(trials)
    lacking = [name for name in names if name not in table]
    needless = [name for name in table if name not in names]
    phrases = []
    if lacking:
        phrases.append(f"has no row for {shortened(lacking)}: start and goal are read off the path")
    if needless:
        phrases.append(f"has rows for trials that are not there: {shortened(needless)}")
    return phrases


def _numbers(file: str | Path, name: str, row: pd.Series[float]) -> Floats:
    """A row's numbers; inf where a dimension is free."""
    values = pd.to_numeric(row, errors="coerce").to_numpy(dtype=float)
    if np.any(np.isnan(values)):
        column = row.index[int(np.argmax(np.isnan(values)))]
        raise ValueError(f"{file}: trial {name!r} has no number for {column}")
    return values
