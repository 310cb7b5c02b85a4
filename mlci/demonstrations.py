"""A task, and a demonstration: a path that somebody took to do it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.spaces import Box, Floats, StateSpace

REACHED = 0.05  # default distance, Euclidean in raw units, within which a state counts as met
_SAME_TIME = 1e-3  # of a horizon: how far a duration may be off, as recorded times are rounded


@dataclass(frozen=True, eq=False)
class Task:
    """Where a demonstrator starts, where it should be at the end, and how long it has.

    Attributes:
        start: (n,) first state.
        goal: region of the last state; infinite sides where it is free, a point in general.
        horizon: duration [s].

    Raises:
        ValueError: a start that is not finite or does not fit the goal, or a horizon <= 0.
    """

    start: Floats
    goal: Box
    horizon: float

    def __post_init__(self) -> None:
        start = np.array(self.start, dtype=float)
        if start.shape != self.goal.lower.shape or not np.all(np.isfinite(start)):
            raise ValueError(
                f"a task needs a finite start of shape {self.goal.lower.shape}, not {start}"
            )
        if not (np.isfinite(self.horizon) and self.horizon > 0):
            raise ValueError(f"a task's horizon must be positive, not {self.horizon} s")
        object.__setattr__(self, "start", start)


@dataclass(frozen=True, eq=False)
class Demonstration:
    """A path that somebody took to do a task, sampled at times that need not be even.

    Attributes:
        task: the task.
        states: (K+1, n) path, without jumps in periodic dimensions.
        controls: (K, m) controls held between the samples, or None where they are not known.
        times: (K+1,) time of each sample [s], rising from 0; `even_times` makes even ones.
        name: what tables and messages call it.

    Raises:
        ValueError: fewer than two samples, shapes that disagree, numbers that are not finite, times
            that do not rise from 0, a first sample further than 0.05 from the task's start, or a
            duration that is not the task's horizon.
    """

    task: Task
    states: Floats
    controls: Floats | None
    times: Floats
    name: str = ""

    def __post_init__(self) -> None:
        states, n = np.array(self.states, dtype=float), len(self.task.start)
        object.__setattr__(self, "states", states)
        if states.ndim != 2 or len(states) < 2 or states.shape[1] != n:
            raise ValueError(
                f"{self._title} needs states of shape (K+1, {n}) with K >= 1, not {states.shape}"
            )
        if self.controls is not None:
            controls = np.array(self.controls, dtype=float)
            object.__setattr__(self, "controls", controls)
            if controls.ndim != 2 or len(controls) != len(states) - 1:
                raise ValueError(
                    f"{self._title} needs controls of shape ({len(states) - 1}, m), "
                    f"not {controls.shape}"
                )
        for word, array in (("states", states), ("controls", self.controls)):
            if array is not None and not np.all(np.isfinite(array)):
                sample = int(np.argmin(np.isfinite(array).all(axis=1)))
                raise ValueError(
                    f"{self._title} has {word} that are not finite, first {array[sample]} at "
                    f"sample {sample}"
                )
        times = np.array(self.times, dtype=float)
        object.__setattr__(self, "times", times)
        if times.shape != (len(states),):
            raise ValueError(f"{self._title} needs {len(states)} times, not {times.shape}")
        if times[0] != 0 or not np.all(np.diff(times) > 0) or not np.isfinite(times[-1]):
            raise ValueError(f"{self._title} needs times that rise from 0, not {times}")
        if np.linalg.norm(states[0] - self.task.start) > REACHED:
            raise ValueError(f"{self._title} starts at {states[0]}, its task at {self.task.start}")
        if not np.isclose(times[-1], self.task.horizon, rtol=1e-6):
            raise ValueError(
                f"{self._title} lasts {times[-1]} s, but its task {self.task.horizon} s"
            )

    @classmethod
    def from_path(
        cls, states: ArrayLike, times: ArrayLike, *, goal: Box | None = None, name: str = ""
    ) -> Demonstration:
        """A recorded path whose task is read off its ends.

        Args:
            states: (K+1, n) path, without jumps in periodic dimensions (`StateSpace.unwrap`).
            times: time between samples, or (K+1,) rising times of any origin [s].
            goal: region that the demonstrator had to reach; None takes the last state.
            name: what tables and messages call it.

        Raises:
            ValueError: as of the constructor.
        """
        path = np.atleast_2d(np.asarray(states, dtype=float))
        region = Box.point(path[-1]) if goal is None else goal
        given = np.asarray(times, dtype=float)
        times = even_times(len(path), float(given)) if given.ndim == 0 else given - given[:1]
        horizon = float(times[-1]) if len(path) > 1 and len(times) else 1.0
        return cls(Task(path[0], region, horizon), path, None, times, name)

    @property
    def _title(self) -> str:
        """Its name in a message."""
        return f"demonstration {self.name!r}" if self.name else "a demonstration"


def even_times(samples: int, dt: float) -> Floats:
    """Times (K+1,) of samples that are dt [s] apart, from 0."""
    return np.arange(samples, dtype=float) * dt


def departures(
    task: Task, path: Floats, duration: float, space: StateSpace, tolerance: float = REACHED
) -> list[str]:
    """What a path does otherwise than its task says, a phrase each; empty if it does the task.

    Args:
        task: the task.
        path: states (K+1, n) of at least two samples; it may jump in periodic dimensions.
        duration: of the path [s].
        space: the state space, whose periodic dimensions are measured the short way round.
        tolerance: how far it may start from the task's start and end from its goal, Euclidean in
            raw units.
    """
    from_start = np.linalg.norm(space.difference(path[0], task.start))
    from_goal = np.linalg.norm(space.excess(path[-1], task.goal))
    phrases = []
    if from_start > tolerance:
        phrases.append(
            f"it starts at {_numbers(path[0])}, {from_start:.3g} from the task's start "
            f"{_numbers(task.start)}"
        )
    if from_goal > tolerance:
        goal = _numbers(task.goal.lower)
        if np.any(task.goal.widths > 0):
            goal += f" to {_numbers(task.goal.upper)}"
        phrases.append(
            f"it ends at {_numbers(path[-1])}, {from_goal:.3g} from the task's goal {goal}"
        )
    if not np.isclose(duration, task.horizon, rtol=_SAME_TIME, atol=0.0):
        phrases.append(f"it lasts {duration:.6g} s, the task {task.horizon:.6g} s")
    return phrases


def _numbers(state: Floats) -> str:
    """A state (n,) in a message."""
    return f"({', '.join(f'{value:.4g}' for value in state)})"
