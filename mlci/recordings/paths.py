"""From a trial to a demonstration: gaps, derivatives, bounds, times and ends of its path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration, Task
from mlci.recordings.bounds import clip_rounding
from mlci.recordings.columns import control_columns
from mlci.recordings.derivatives import derive
from mlci.recordings.gaps import bridge_gaps
from mlci.recordings.named import box_of
from mlci.recordings.recording import Recording, goal_columns
from mlci.recordings.times import rising
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System


@dataclass(frozen=True, eq=False)
class Repair:
    """How samples that are missing are made.

    Attributes:
        gap: (n,) how far a path may go in a gap that is bridged [unit of x]; None bridges none.
        derived: for the name of each derivative that was not recorded that of its state.
        window: of the cubics that give derivatives [s].
    """

    gap: ArrayLike | None = None
    derived: Mapping[str, str] = field(default_factory=dict)
    window: float = 0.2


def demonstration_of(
    name: str,
    recording: Recording,
    frame: pd.DataFrame,
    system: System,
    repair: Repair,
    start: ArrayLike | None,
    goal: Box | None,
    tolerance: float,
) -> tuple[Demonstration, list[str]]:
    """Check a trial and make it a demonstration; also what was done to its path.

    Args:
        name: of the demonstration.
        recording: that the trial is from.
        frame: its rows of the recording's frame.
        system: the system.
        repair: how missing samples are made.
        start: (n,) first state; None takes the first sample.
        goal: goal; None takes what the file says, or else the last sample.
        tolerance: how far it may begin from `start` or end from `goal`.

    Raises:
        ValueError: what is wrong with it, and where.
    """
    space = system.space
    if len(frame) < 2:
        raise ValueError(f"has {len(frame)} sample(s): a demonstration needs at least 2")
    _times(recording, frame)  # gaps and derivatives need times that rise
    gap = np.zeros(space.dimension) if repair.gap is None else np.asarray(repair.gap, dtype=float)
    recorded = frame.drop(columns=[name for name in repair.derived if name in frame])
    whole, notes = bridge_gaps(recorded, space, gap, recording.place)
    if len(whole) < 2:
        raise ValueError(f"has {len(whole)} sample with all states: it needs at least 2")
    if repair.derived:
        whole = derive(whole, space, repair.derived, repair.window)
    states, note = clip_rounding(
        whole[list(space.names)].to_numpy(dtype=float),
        space,
        lambda sample, of: recording.place(int(whole.index[sample]), of),
    )
    times, states = _times(recording, whole), space.unwrap(states)
    first = states[0].copy() if start is None else np.asarray(start, dtype=float)
    away = space.difference(states[0], first)
    states = states - (states[0] - first - away)  # whole turns, exactly 0 for its own start
    region = goal or _goal(recording, frame, space) or Box.point(states[-1])
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
    controls = _controls(whole, system)
    return Demonstration(task, states, controls, times, name), [*notes, *([note] if note else [])]


def _times(recording: Recording, frame: pd.DataFrame) -> Floats:
    """Times (K+1,) of a trial from 0 [s], which must rise."""
    return rising(
        frame["time"].to_numpy(dtype=float),
        recording.time_resolution,
        lambda sample: recording.place(int(frame.index[sample])),
    )


def _controls(frame: pd.DataFrame, system: System) -> Floats | None:
    """Controls (K, m) if there is a finite one for every sample but the last, else None."""
    names = control_columns(system)
    if not set(names) <= set(frame.columns):
        return None
    held = frame[names].to_numpy(dtype=float)[:-1]
    return held if np.all(np.isfinite(held)) else None


def _goal(recording: Recording, frame: pd.DataFrame, space: StateSpace) -> Box | None:
    """The goal that the file states: in the trial's first line, or once for all."""
    names = goal_columns(space)
    if not set(names) <= set(frame.columns):
        return recording.goal
    return box_of(frame[names].iloc[0].to_numpy(dtype=float).reshape(2, -1))
