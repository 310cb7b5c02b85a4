"""A simulated demonstrator who moves optimally and keeps out of the truth (section V-B).

Trial i of a study draws its task and the first guesses of its restarts from a generator of its own,
so it is the same whatever the number of trials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mlci.control.control_problem import ControlFilter, SafeStates
from mlci.control.ilqr import Solution, optimize
from mlci.demonstrations import REACHED, Demonstration, Task, even_times
from mlci.regions import Regions
from mlci.simulate import EULER, Integrator, rollout, step_count
from mlci.spaces import Bools, Box, Floats
from mlci.systems import System

_DRAWS = 10_000  # attempts to find a safe state before the start box counts as unsafe
_TIE = 1e-9  # share of a cost: those that differ by less are equal
_RISE = 4.0  # a rate between two samples is at most so many times that of the first
_POINTS_BETWEEN = 10  # points between two samples at which the truth is looked for


@dataclass(frozen=True, eq=False)
class Trial:
    """A task and the first guesses from which the demonstrator tries it.

    Attributes:
        task: the task.
        guesses: (R, K, m) one control sequence a restart.
        noise: (K, m) on the controls when the best that was found is carried out, see `optimize`.

    Raises:
        ValueError: guesses that are empty or do not have three axes.
    """

    task: Task
    guesses: Floats
    noise: Floats | None = None

    def __post_init__(self) -> None:
        if self.guesses.ndim != 3 or not self.guesses.size:
            raise ValueError(f"a trial needs guesses (R, K, m), not {self.guesses.shape}")


class Outcome(StrEnum):
    """What became of a trial; where several reasons hold, the first of this list is named."""

    TRUTH_ENTERED = "truth_entered"
    BOUNDS_LEFT = "bounds_left"
    GOAL_MISSED = "goal_missed"
    KEPT = "kept"


@dataclass(frozen=True, eq=False)
class Attempt:
    """The best restart of a trial.

    Attributes:
        demonstration: the path, whether it was kept or not.
        outcome: kept, or why not.
        cost: the optimiser's cost: minus the reward on the way, plus the goal's penalty.
        miss: distance of the last state from the goal, Euclidean in raw units; by any winding
            that the demonstrator may take.
        restart: which first guess led to it.
    """

    demonstration: Demonstration
    outcome: Outcome
    cost: float
    miss: float
    restart: int


def sample_trials(
    system: System,
    safe_set: SafeStates | None,
    start_box: Box,
    *,
    trials: int,
    seed: int,
    horizon: float,
    dt: float,
    first: int = 0,
    margin: float = 0.0,
    goal_offsets: Box | None = None,
    restarts: int = 3,
    hold: float = 0.5,
    control_noise: ArrayLike | None = None,
) -> list[Trial]:
    """Draw tasks, uniformly among safe starts and goals, and first guesses for them.

    Args:
        safe_set: starts and goals are drawn anew until they lie in it; None allows all.
        start_box: finite box of starts and goals.
        trials: number of trials.
        seed: of the study; trial i depends on it and on i only.
        horizon: duration of a task [s].
        dt: sampling time [s], which divides the horizon.
        first: index of the first trial.
        margin: V that starts and goals must have at least.
        goal_offsets: the goal region, relative to the goal state that was drawn; None for a point.
        restarts: R, guesses for each trial.
        hold: time for which a guess holds a control [s].
        control_noise: (m,) root of the power of white noise on the controls, in their unit times
            the root of a second: a sample has this by the root of dt for standard deviation. None
            for no noise.

    Raises:
        ValueError: a horizon that dt does not divide, or a start box with no safe state.
    """
    steps = step_count(horizon, dt)
    n = system.space.dimension
    if start_box.dimension != n or not np.all(np.isfinite(start_box.widths)):
        raise ValueError(f"a start box needs {n} finite sides: {start_box}")
    offsets = Box.point(np.zeros(n)) if goal_offsets is None else goal_offsets
    per_hold = max(1, round(hold / dt))
    drawn = []
    for trial in range(first, first + trials):
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial,)))
        start = _draw_safe(rng, start_box, safe_set, margin)
        goal = _draw_safe(rng, start_box, safe_set, margin)
        guesses = first_guesses(rng, system.control_box, steps, per_hold, restarts)
        task = Task(start, Box(goal + offsets.lower, goal + offsets.upper), horizon)
        noise = None
        if control_noise is not None:
            shape = steps, system.control_box.dimension
            noise = rng.standard_normal(shape) * np.asarray(control_noise) / np.sqrt(dt)
        drawn.append(Trial(task, guesses, noise))
    return drawn


def first_guesses(
    rng: np.random.Generator, control_box: Box, steps: int, per_hold: int, restarts: int
) -> Floats:
    """Random controls (R, K, m), uniform in the control box and held for some steps.

    Noise that changed with every sample would average out, and all restarts would follow the same
    path.

    Args:
        rng: the generator.
        control_box: finite range of the controls.
        steps: K.
        per_hold: steps for which a control is held.
        restarts: R.
    """
    size = restarts, -(-steps // per_hold), control_box.dimension
    levels = rng.uniform(control_box.lower, control_box.upper, size=size)
    return np.repeat(levels, per_hold, axis=1)[:, :steps]


def demonstrate(
    system: System,
    trials: Sequence[Trial],
    truth: Regions | None,
    safety_filter: ControlFilter | None,
    *,
    dt: float,
    goal_weight: float = 300.0,
    iterations: int = 10,
    goal_tolerance: float = REACHED,
    wind: bool = True,
    limit: Box | None = None,
    integrator: Integrator = EULER,
) -> list[Attempt]:
    """Let the demonstrator try every trial: equation (8) from each guess, of which the best counts.

    It maximises the system's `running_reward`. The best restart is the cheapest that could be kept;
    if none could, the cheapest.

    Args:
        trials: at least one; all with guesses of one shape, and all with noise or none.
        truth: the regions that the demonstrator may not enter.
        safety_filter: keeps it out of them; None lets it go anywhere.
        dt: sampling time [s].
        goal_weight: price of the squared terminal error.
        iterations: of the optimiser.
        goal_tolerance: largest distance from the goal that counts as reached, in raw units.
        wind: whether any number of turns may lead to a goal, see `optimize`.
        limit: range of the controls, such as the control box; None for no limit.
        integrator: how states move on; the filter's is to be the same.

    Returns:
        One attempt a trial, in their order.
    """
    tasks, restarts = [trial.task for trial in trials], len(trials[0].guesses)
    noises = [trial.noise for trial in trials if trial.noise is not None]
    solution = optimize(
        system,
        np.repeat([task.start for task in tasks], restarts, axis=0),
        np.repeat([task.goal.lower for task in tasks], restarts, axis=0),
        np.repeat([task.goal.upper for task in tasks], restarts, axis=0),
        np.concatenate([trial.guesses for trial in trials]),
        dt,
        goal_weight=goal_weight,
        iterations=iterations,
        safety_filter=safety_filter,
        wind=wind,
        limit=limit,
        integrator=integrator,
        noise=np.repeat(noises, restarts, axis=0) if noises else None,
    )
    misses = np.linalg.norm(solution.excess, axis=-1)
    entered = np.zeros(len(misses), dtype=bool)
    if truth is not None:
        entered = enters(system, truth, solution.states, solution.controls, dt)
    left = ~np.all(system.space.contains(solution.states), axis=-1)
    failures = np.stack([entered, left, ~(misses <= goal_tolerance)])
    return _best_of(restarts, tasks, solution, failures, misses, dt)


def crossing(
    system: System, trials: Sequence[Trial], truth: Regions, *, dt: float, **options: Any
) -> list[Trial]:
    """The trials for which the truth matters: the optimum, were it not there, enters it.

    Args:
        trials: at least one; those that the unconstrained demonstrator fails do not count.
        dt: sampling time [s].
        options: more of `demonstrate`'s arguments.
    """
    attempts = demonstrate(system, trials, None, None, dt=dt, **options)
    states = np.array([attempt.demonstration.states for attempt in attempts])
    controls = np.array([attempt.demonstration.controls for attempt in attempts])
    entered = enters(system, truth, states, controls, dt)
    return [
        trial
        for trial, attempt, through in zip(trials, attempts, entered, strict=True)
        if attempt.outcome is Outcome.KEPT and through
    ]


def enters(system: System, truth: Regions, states: Floats, controls: Floats, dt: float) -> Bools:
    """Which paths (B,) enter a region of the truth.

    Looked for on the straight lines between samples, which are Euler's steps, and at ten points
    between samples of the motion that the held control makes, which Runge-Kutta steps follow.

    Args:
        states: (B, K+1, n) paths.
        controls: (B, K, m) controls that were applied.
        dt: time between samples [s].
    """
    before, entered = states[:, :-1], np.asarray(np.any(truth.violated_by(states), axis=-1))
    reach = _RISE * dt * np.linalg.norm(system.dynamics(before, controls), axis=-1)
    close = np.nonzero(truth.signed_distance(before) < reach)
    motion = rollout(system, before[close], controls[close][:, None], dt, _POINTS_BETWEEN + 1)
    entered[close[0][np.any(truth.signed_distance(motion) < 0, axis=-1)]] = True
    return entered


def _draw_safe(
    rng: np.random.Generator, box: Box, safe_set: SafeStates | None, margin: float
) -> Floats:
    """A state (n,), uniform in the part of a box that is safe."""
    for _ in range(_DRAWS):
        state = rng.uniform(box.lower, box.upper)
        if safe_set is None or safe_set.contains(state, margin):
            return state
    raise ValueError(
        f"none of {_DRAWS} states drawn from {box} has V >= {margin}: choose a start box that "
        "meets the safe set"
    )


def _best_of(
    restarts: int,
    tasks: Sequence[Task],
    solution: Solution,
    failures: Bools,
    misses: Floats,
    dt: float,
) -> list[Attempt]:
    """The best restart of each task, by failures (3, B), in the order of outcomes, and costs.

    Of restarts with equal costs, but for rounding, the first.
    """
    failed, costs = (v.reshape(-1, restarts) for v in (failures.any(axis=0), solution.cost))
    among = (failed == np.min(failed, axis=1, keepdims=True)) & ~np.isnan(costs)
    costs = np.where(among, costs, np.inf)
    lowest = np.min(costs, axis=1, keepdims=True)
    chosen = np.argmax(costs <= lowest + _TIE * np.abs(lowest), axis=1)
    attempts = []
    for number, best in enumerate((np.arange(len(tasks)) * restarts + chosen).tolist()):
        outcome = list(Outcome)[int(np.argmax([*failures[:, best], True]))]
        path, controls = solution.states[best], solution.controls[best]
        times, name = even_times(len(path), dt), f"trial_{number:03d}"
        demonstration = Demonstration(tasks[number], path, controls, times, name)
        cost, miss, restart = float(solution.cost[best]), float(misses[best]), best % restarts
        attempts.append(Attempt(demonstration, outcome, cost, miss, restart))
    return attempts
