"""Writing a demonstration as a recorded file."""

from __future__ import annotations

import csv
from pathlib import Path

from mlci.demonstrations import Demonstration
from mlci.recordings.recording import goal_columns
from mlci.spaces import StateSpace


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
            values = [float(demonstration.times[k]), *state.tolist()]
            at_goal = corners if k == 0 else [""] * len(corners)
            writer.writerow([*map(repr, values), *held, *at_goal])
