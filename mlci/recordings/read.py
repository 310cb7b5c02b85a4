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
from mlci.recordings.copies import distinct
from mlci.recordings.files import MAX_MEMORY, find_files, read_table
from mlci.recordings.named import to_recording
from mlci.recordings.paths import Repair, demonstration_of
from mlci.recordings.recording import Layout, Remark, shown_path
from mlci.recordings.table import NoRecording
from mlci.recordings.task_table import Ends, unmatched
from mlci.recordings.trials import split_trials
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
    group_by: Sequence[str] = (),
    repair: Repair | None = None,
    tasks: Mapping[str, Ends] | None = None,
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
        group_by: columns that together name the trials of a file; time that starts again starts
            another trial in any case.
        repair: how missing samples are made; None fills no gap and derives nothing.
        tasks: start and goal of trials by their names, as of `read_task_table`.
        start: (n,) first state of every task; None takes each file's first sample.
        goal: goal of every task; None takes what each file says, or else its last sample.
        tolerance: how far a path may begin from `start` or end from `goal`, Euclidean in raw
            units and by the nearest winding.
        max_memory: what reading one file may take [MB].

    Returns:
        The demonstrations in the order of the paths, those of a folder or pattern by name, without
        jumps in periodic dimensions, and each once, whatever its copies; named after their files
        and, where a file has several, their trials. What was wrong with the rest; and what was
        assumed.

    Raises:
        ValueError: a dt that is not positive.
    """
    if not dt > 0:
        raise ValueError(f"the time step of files without a header must be positive, not {dt} s")
    repair, table = repair or Repair(), tasks or {}
    layout = Layout(columns or {}, units or {}, time_unit, dt, group_by, tuple(repair.derived))
    files, problems = find_files([paths] if isinstance(paths, str | Path) else paths)
    stems, wants = Counter(file.stem for file in files), wanted(system, layout)
    demonstrations, notes, names = list[Demonstration](), list[Remark](), list[str]()
    for file in files:
        shown = shown_path(file)
        name = shown if stems[file.stem] > 1 else shown_path(Path(file.stem))
        try:
            recording = to_recording(read_table(file, wants, max_memory), system, layout)
            trials, split = split_trials(recording, group_by)
        except NoRecording as error:
            if files[file]:
                problems.append(_remark(shown, error))
            else:
                notes.append(Remark(shown, f"{error}, and is passed over"))
            continue
        except ValueError as error:
            problems.append(_remark(shown, error))
            continue
        notes += [Remark(shown, note) for note in (*recording.notes, *split)]
        for trial in trials:
            title = f"{name}_{trial.name}" if trial.name else name
            at = f"{shown}, trial {trial.name}" if trial.name else shown
            ends = table.get(title, Ends(None, None))
            first = start if ends.start is None else ends.start
            last = goal if ends.goal is None else ends.goal
            names.append(title)
            try:
                demonstration, done = demonstration_of(
                    title, recording, trial.frame, system, repair, first, last, tolerance
                )
            except ValueError as error:
                problems.append(_remark(at, error))
                continue
            demonstrations.append(demonstration)
            notes += [Remark(at, note) for note in done]
    demonstrations, copies = distinct(demonstrations, system.space)
    notes += [Remark(copy, f"is a copy of {of}, and is not counted") for copy, of in copies]
    notes += [Remark("tasks", phrase) for phrase in (unmatched(table, names) if tasks else ())]
    return Readings(demonstrations, problems, notes)


def _remark(file: str, error: ValueError) -> Remark:
    """What is wrong with a file, in a line."""
    return Remark(file, " ".join(str(error).split()))
