"""Recorded demonstrations: files in, `Demonstration` out, and back.

`mlci.recordings.formats` says what the files hold. Only the states count.
"""

from __future__ import annotations

import csv
import glob
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mlci.demonstrations import REACHED, Demonstration, Task
from mlci.recordings.formats import READERS, Recording, goal_columns
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System

_UNEVEN = 0.1  # of a time step: more than the rounding of printed times, less than a lost sample


@dataclass(frozen=True)
class Problem:
    """A file that could not be used, and what to do about it."""

    file: str
    message: str

    def __str__(self) -> str:
        return f"{self.file}: {self.message}"


def read_demonstrations(
    paths: str | Path | Sequence[str | Path],
    system: System,
    *,
    dt: float = 0.01,
    start: ArrayLike | None = None,
    goal: Box | None = None,
    tolerance: float = REACHED,
) -> tuple[list[Demonstration], list[Problem]]:
    """Read recorded demonstrations; a file that cannot be used does not stop the others.

    Args:
        paths: a folder, a glob pattern or a file, or several of them.
        system: whose state space names the columns and bounds the states.
        dt: time step of files without a header [s].
        start: (n,) first state of every task; None takes each file's first sample.
        goal: goal of every task; None takes what each file says, or else its last sample.
        tolerance: how far a path may begin from `start` or end from `goal`, Euclidean in raw
            units and by the nearest winding.

    Returns:
        The demonstrations in the order of the paths, those of a folder or pattern by name, without
        jumps in periodic dimensions and named after their files; and what was wrong with the rest.

    Raises:
        ValueError: a dt that is not positive.
    """
    if not dt > 0:
        raise ValueError(f"the time step of files without a header must be positive, not {dt} s")
    files, problems = _files([paths] if isinstance(paths, str | Path) else paths)
    stems = Counter(file.stem for file in files)
    demonstrations = []
    for file in files:
        name = file.stem if stems[file.stem] == 1 else str(file)
        try:
            recording = _read(file, system, dt)
            demonstrations.append(
                _demonstration(name, recording, system.space, start, goal, tolerance)
            )
        except (ValueError, OSError) as error:
            problems.append(Problem(str(file), " ".join(str(error).split())))
    return demonstrations, problems


def write_demonstration(path: str | Path, demonstration: Demonstration, space: StateSpace) -> None:
    """Write a CSV with a header, from which the same numbers are read back, bit by bit.

    The goal is in the line of the first sample. The start is not written: a reader takes the first
    sample for it.
    """
    controls, goal = demonstration.controls, demonstration.task.goal
    corners = [repr(value) for value in [*goal.lower.tolist(), *goal.upper.tolist()]]
    names = [] if controls is None else [f"control_{i + 1}" for i in range(controls.shape[1])]
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *space.names, *names, *goal_columns(space)])
        for k, state in enumerate(demonstration.states):
            held = [""] * len(names)
            if controls is not None and k < len(controls):
                held = [repr(value) for value in controls[k].tolist()]
            values = [k * demonstration.dt, *state.tolist()]
            at_goal = corners if k == 0 else [""] * len(corners)
            writer.writerow([*map(repr, values), *held, *at_goal])


def _files(paths: Sequence[str | Path]) -> tuple[list[Path], list[Problem]]:
    """The files that paths stand for, each once; a problem for a path that stands for none."""
    found: dict[Path, None] = {}
    problems = []
    for path in map(Path, paths):
        if path.is_dir():
            inside = [item for item in path.iterdir() if item.suffix.lower() in READERS]
        elif path.exists():
            inside = [path]
        else:
            inside = [Path(item) for item in glob.glob(str(path), recursive=True)]
        if not inside:
            empty = f"holds no {' or '.join(READERS)} file"
            problems.append(Problem(str(path), empty if path.is_dir() else "there is no such file"))
        found.update(dict.fromkeys(sorted(inside)))
    return list(found), problems


def _read(file: Path, system: System, dt: float) -> Recording:
    """Read one file by its suffix."""
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise ValueError(f"cannot read {file.suffix!r} files: convert it to {', '.join(READERS)}")
    return reader(file, system, dt)


def _demonstration(
    name: str,
    recording: Recording,
    space: StateSpace,
    start: ArrayLike | None,
    goal: Box | None,
    tolerance: float,
) -> Demonstration:
    """Check a recording and make it a demonstration."""
    states, time, place = recording.states, recording.time, recording.place
    if len(states) < 2:
        raise ValueError(f"has {len(states)} sample(s): a demonstration needs at least 2")
    for bad, reason in (
        (~np.isfinite(states), "is not a finite number: remove or repair the sample"),
        (
            ~space.periodic & ((states < space.bounds.lower) | (states > space.bounds.upper)),
            "leaves the state space: widen its bounds in the configuration or drop the file",
        ),
    ):
        if bad.any():
            sample, d = (int(index) for index in np.argwhere(bad)[0])
            raise ValueError(
                f"{place(sample, d)}: {space.names[d]} = {states[sample, d]:g} {reason} "
                f"(bounds {space.bounds.lower[d]:g} to {space.bounds.upper[d]:g})"
            )
    dt = _even_step(time, place)
    states = space.unwrap(states)
    first = states[0].copy() if start is None else np.asarray(start, dtype=float)
    away = space.difference(states[0], first)
    states = states - (states[0] - first - away)  # whole turns, exactly 0 for its own start
    region = goal or recording.goal or Box.point(states[-1])
    for word, distance in (
        ("begins", np.linalg.norm(away)),
        ("ends", np.linalg.norm(space.excess(states[-1], region))),
    ):
        if distance > tolerance:
            end = "start" if word == "begins" else "goal"
            raise ValueError(
                f"{word} {distance:.3g} away from the {end} that was given, more than "
                f"{tolerance:g}: leave the {end} out to take it off the file"
            )
    return Demonstration(
        Task(first, region, (len(states) - 1) * dt), states, recording.controls, dt, name
    )


def _even_step(time: Floats, place: Callable[[int, int], str]) -> float:
    """The time step of evenly sampled times [s]."""
    steps = np.diff(time)
    usual = float(np.nanmedian(steps)) if np.any(np.isfinite(steps)) else float("nan")
    bad = ~((steps > 0) & (np.abs(steps - usual) <= _UNEVEN * usual))
    if bad.any():
        sample = int(np.argmax(bad)) + 1
        raise ValueError(
            f"{place(sample, -1)}: time goes from {time[sample - 1]:g} to {time[sample]:g} s where "
            f"a step is {usual:g} s: sample the path again at even times"
        )
    # The first step is exact where times are k dt; the mean is better where they were rounded.
    mean = float(time[-1] - time[0]) / len(steps)
    return float(steps[0]) if abs(steps[0] - mean) <= 1e-9 * mean else mean
