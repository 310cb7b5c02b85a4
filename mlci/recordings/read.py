"""Recorded demonstrations: from files to `Demonstration`.

A file becomes a `Table` as it stands, that a `Recording` in the system's names and units, that
trials, and each of those a demonstration.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from numpy.typing import ArrayLike

from mlci.demonstrations import REACHED, Demonstration
from mlci.recordings.columns import wanted
from mlci.recordings.files import MAX_MEMORY, find_files, read_table
from mlci.recordings.named import to_recording
from mlci.recordings.recording import Layout, Remark, shown_path
from mlci.recordings.trials import demonstration_of, split
from mlci.spaces import Box
from mlci.systems import System


class Readings(NamedTuple):
    """What came of reading files: demonstrations, what was wrong, and what was assumed."""

    demonstrations: list[Demonstration]
    problems: list[Remark]
    notes: list[Remark]


def read_demonstrations(
    paths: str | Path | Sequence[str | Path],
    system: System,
    *,
    dt: float = 0.01,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    time_unit: str | None = None,
    start: ArrayLike | None = None,
    goal: Box | None = None,
    tolerance: float = REACHED,
    max_memory: float = MAX_MEMORY,
) -> Readings:
    """Read recorded demonstrations; a file that cannot be used does not stop the others.

    Args:
        paths: a folder, a glob pattern or a file, or several of them.
        system: whose state space names the columns, bounds the states and has units.
        dt: time between samples of files that do not tell it [s].
        columns: a file's name for a state, for `time`, or for an array of all `states`, by ours.
        units: unit of a state in the files, by its name; None takes what they say, or the system's.
        time_unit: unit of time in the files; None takes what they say, or seconds.
        start: (n,) first state of every task; None takes each file's first sample.
        goal: goal of every task; None takes what each file says, or else its last sample.
        tolerance: how far a path may begin from `start` or end from `goal`, Euclidean in raw
            units and by the nearest winding.
        max_memory: what reading one file may take [MB].

    Returns:
        The demonstrations in the order of the paths, those of a folder or pattern by name, without
        jumps in periodic dimensions and named after their files; what was wrong with the rest; and
        what was assumed.

    Raises:
        ValueError: a dt that is not positive.
    """
    if not dt > 0:
        raise ValueError(f"the time step of files without a header must be positive, not {dt} s")
    layout = Layout(columns or {}, units or {}, time_unit, dt)
    files, problems = find_files([paths] if isinstance(paths, str | Path) else paths)
    stems, wants = Counter(file.stem for file in files), wanted(system, layout)
    demonstrations, notes = [], []
    for file in files:
        shown = shown_path(file)
        name = shown if stems[file.stem] > 1 else shown_path(Path(file.stem))
        try:
            recording = to_recording(read_table(file, wants, max_memory), system, layout)
            notes += [Remark(shown, note) for note in recording.notes]
            for trial in split(recording, name):
                demonstrations.append(demonstration_of(trial, system, start, goal, tolerance))
        except ValueError as error:
            problems.append(Remark(shown, " ".join(str(error).split())))
    return Readings(demonstrations, problems, notes)
