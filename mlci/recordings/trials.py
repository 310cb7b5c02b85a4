"""From a recording to the trials in it, and from a trial to a demonstration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration, Task
from mlci.recordings.columns import control_columns
from mlci.recordings.named import box_of
from mlci.recordings.recording import Recording, goal_columns
from mlci.recordings.times import rising
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System


@dataclass(frozen=True, eq=False)
class Trial:
    """The samples of one trial: rows of a recording's frame, under their numbers there."""

    name: str
    recording: Recording
    frame: pd.DataFrame


def split(recording: Recording, name: str) -> list[Trial]:
    """The trials of a recording."""
    return [Trial(name, recording, recording.frame)]


def demonstration_of(
    trial: Trial,
    system: System,
    start: ArrayLike | None,
    goal: Box | None,
    tolerance: float,
) -> Demonstration:
    """Check a trial and make it a demonstration.

    Args:
        trial: the trial.
        system: the system.
        start: (n,) first state; None takes the first sample.
        goal: goal; None takes what the file says, or else the last sample.
        tolerance: how far it may begin from `start` or end from `goal`.

    Raises:
        ValueError: what is wrong with it, and where.
    """
    space, frame, recording = system.space, trial.frame, trial.recording
    if len(frame) < 2:
        raise ValueError(f"has {len(frame)} sample(s): a demonstration needs at least 2")
    states = frame[list(space.names)].to_numpy(dtype=float)
    _refuse_states(trial, states, space)
    times = rising(
        frame["time"].to_numpy(dtype=float),
        recording.time_resolution,
        lambda sample: recording.place(int(frame.index[sample])),
    )
    states = space.unwrap(states)
    first = states[0].copy() if start is None else np.asarray(start, dtype=float)
    away = space.difference(states[0], first)
    states = states - (states[0] - first - away)  # whole turns, exactly 0 for its own start
    region = goal or _goal(trial, space) or Box.point(states[-1])
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
    task = Task(first, region, float(times[-1]))
    return Demonstration(task, states, _controls(trial, system), times, trial.name)


def _refuse_states(trial: Trial, states: Floats, space: StateSpace) -> None:
    """Refuse states (K+1, n) that are no numbers, or outside the space."""
    for bad, reason in (
        (~np.isfinite(states), "is not a finite number: remove or repair the sample"),
        (
            ~space.periodic & ((states < space.bounds.lower) | (states > space.bounds.upper)),
            "leaves the state space: widen its bounds in the configuration or drop the file",
        ),
    ):
        if bad.any():
            sample, d = (int(index) for index in np.argwhere(bad)[0])
            name = space.names[d]
            place = trial.recording.place(int(trial.frame.index[sample]), name)
            raise ValueError(
                f"{place}: {name} = {states[sample, d]:g} {reason} "
                f"(bounds {space.bounds.lower[d]:g} to {space.bounds.upper[d]:g})"
            )


def _controls(trial: Trial, system: System) -> Floats | None:
    """Controls (K, m) if there is a finite one for every sample but the last, else None."""
    names = control_columns(system)
    if not set(names) <= set(trial.frame.columns):
        return None
    held = trial.frame[names].to_numpy(dtype=float)[:-1]
    return held if np.all(np.isfinite(held)) else None


def _goal(trial: Trial, space: StateSpace) -> Box | None:
    """The goal that the file states: in the trial's first line, or once for all."""
    names = goal_columns(space)
    if not set(names) <= set(trial.frame.columns):
        return trial.recording.goal
    return box_of(trial.frame[names].iloc[0].to_numpy(dtype=float).reshape(2, -1))
