"""Tasks like some that were recorded, and simulated demonstrations without a constraint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mlci.demonstrations import Demonstration, Task
from mlci.demonstrator import Outcome, Trial, demonstrate, first_guesses
from mlci.models import Model
from mlci.simulate import RK4
from mlci.spaces import Bools, Box, Floats, StateSpace

_SAMPLES = 100  # of a simulated path, at least; Runge-Kutta steps are exact enough with fewer
_HOLDS = 10  # controls that a first guess holds
_ATTEMPTS = 100  # to draw a task inside the state space


def similar_demonstrations(
    model: Model,
    tasks: Sequence[Task | Demonstration],
    trials: int,
    rng: np.random.Generator,
    *,
    restarts: int = 3,
    **skill: Any,
) -> list[Demonstration]:
    """What a simulated demonstrator does, without a constraint, of tasks like some.

    Args:
        model: the model, whose time step divides the durations.
        tasks: tasks, or demonstrations of them.
        trials: tasks that are tried; those that the demonstrator fails are left out.
        rng: of tasks and first guesses.
        restarts: first guesses of a trial.
        skill: more of `mlci.demonstrator.demonstrate`'s arguments.

    Raises:
        ValueError: no task.
    """
    plain = [each.task if isinstance(each, Demonstration) else each for each in tasks]
    drawn = similar_tasks(model.regions.space, plain, trials, rng)
    paths: list[Demonstration] = []
    by_steps: dict[int, list[Task]] = {}
    for task in drawn:
        by_steps.setdefault(max(1, round(task.horizon / model.dt)), []).append(task)
    for steps, alike in sorted(by_steps.items()):
        pieces = -(-_SAMPLES // steps)  # of a step of the model
        guesses = [
            first_guesses(
                rng, model.system.control_box, steps * pieces, steps * pieces // _HOLDS, restarts
            )
            for _ in alike
        ]
        tried = [
            Trial(Task(task.start, task.goal, steps * model.dt), guess)
            for task, guess in zip(alike, guesses, strict=True)
        ]
        attempts = demonstrate(
            model.system, tried, None, None, dt=model.dt / pieces, integrator=RK4, **skill
        )
        paths += [a.demonstration for a in attempts if a.outcome is Outcome.KEPT]
    return paths


def similar_tasks(
    space: StateSpace, tasks: Sequence[Task], count: int, rng: np.random.Generator
) -> list[Task]:
    """Tasks from a smooth distribution through some: each is one of them, moved a little.

    Start and goal of a task that is drawn, with replacement, are moved by normal noise; its
    standard deviation in each dimension is that of the starts or goals among the tasks, by Scott's
    rule: times N^(-1 / (n + 4)). One that is moved out of the space is moved anew. Of a single
    task there are copies.

    Raises:
        ValueError: no task.
    """
    if not tasks:
        raise ValueError("calibration needs at least one task")
    shrink = len(tasks) ** (-1 / (space.dimension + 4))
    starts = np.array([task.start for task in tasks])
    middles = np.array([_middle(task.goal) for task in tasks])
    spread = [shrink * _deviation(space, states) for states in (starts, middles)]
    drawn = []
    for number in rng.integers(0, len(tasks), count).tolist():
        task = tasks[number]
        shift = [
            _shift(space, rng, states[number], of)
            for states, of in zip((starts, middles), spread, strict=True)
        ]
        goal = Box(task.goal.lower + shift[1], task.goal.upper + shift[1])
        drawn.append(Task(task.start + shift[0], goal, task.horizon))
    return drawn


def _middle(goal: Box) -> Floats:
    """The middle (n,) of a goal; NaN where it is free."""
    with np.errstate(invalid="ignore"):
        return (goal.lower + goal.upper) / 2


def _deviation(space: StateSpace, states: Floats) -> Floats:
    """Standard deviation (n,) of states (N, n), the short way round; 0 where they are free."""
    turn = 2 * np.pi * (states - space.bounds.lower) / space.bounds.widths
    mean_angle = np.angle(np.mean(np.exp(1j * turn), axis=0))
    around = space.bounds.lower + space.bounds.widths * mean_angle / (2 * np.pi)
    centre = np.where(space.periodic, around, np.mean(states, axis=0))
    return np.nan_to_num(np.sqrt(np.mean(space.difference(states, centre) ** 2, axis=0)))


def _shift(space: StateSpace, rng: np.random.Generator, state: Floats, deviation: Floats) -> Floats:
    """Normal noise (n,) that leaves a state in the space; none if it hardly ever does."""
    for _ in range(_ATTEMPTS):
        shift = rng.normal(0.0, deviation)
        if np.all(np.isnan(state) | space.periodic | _within(space, state + shift)):
            return shift
    return np.zeros(len(state))


def _within(space: StateSpace, state: Floats) -> Bools:
    """In which dimensions (n,) a state is between the bounds."""
    return (state >= space.bounds.lower) & (state <= space.bounds.upper)
