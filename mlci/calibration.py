"""How often Phi comes true, by simulation: the map that calibrates evidence, and how good it is.

Nobody knows how recorded people would move if nothing were forbidden, but a simulated demonstrator
can be let go. `calibrate` lets it do tasks like the recorded ones without a constraint, and sees
which regions it crosses, against what the tabular model forecasts. One half of the tasks fits a
map, by which the other half is judged; the map that is used is fitted on both.

What this assumes is that people move like the demonstrator: as far as they do not, evidence is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.crossings import ANY, Crossing, crossed
from mlci.demonstrations import REACHED, Demonstration, Task
from mlci.demonstrator import Outcome, Trial, demonstrate, first_guesses
from mlci.forecast_scores import ForecastScores, score_forecasts
from mlci.forecasts import ForecastMap, fit_map, is_possible
from mlci.preparation import prepare
from mlci.region_sizes import region_sizes
from mlci.regions import Regions, as_mask
from mlci.simulate import RK4
from mlci.spaces import Bools, Box, Floats, StateSpace
from mlci.tabular import Progress, TabularModel

FEWEST = 20  # demonstrations from which a map can be fitted and judged
_SAMPLES = 100  # of a simulated path, at least; Runge-Kutta steps are exact enough with fewer
_HOLDS = 10  # controls that a first guess holds
_ATTEMPTS = 100  # to draw a task inside the state space


@dataclass(frozen=True, eq=False)
class Calibration:
    """The map of forecasts, and how good forecasts are without and with it.

    Attributes:
        tried: tasks that the demonstrator tried without a constraint.
        used: those that it did, and that the tabular model can do.
        map: fitted on all of them; None where they are too few.
        before: scores of Phi itself on the tasks of the second half.
        after: scores there of the map of the first half.
        out_of_reach: share of the regions out of the model's reach that were crossed nevertheless,
            in both halves; None if there are none.
    """

    tried: int
    used: int
    map: ForecastMap | None = None
    before: ForecastScores | None = None
    after: ForecastScores | None = None
    out_of_reach: float | None = None

    def summary(self) -> str:
        """What was found, in a line or two."""
        if self.map is None or self.before is None or self.after is None:
            return (
                f"evidence is not calibrated: of {self.tried} tasks like these, the simulated "
                f"demonstrator and the tabular model can do {self.used} without a constraint, and "
                f"{FEWEST} with regions to cross are needed"
            )
        return (
            f"evidence is calibrated, assuming that people move like the simulated demonstrator: "
            f"over {self.used} tasks like these, forecasts are off by {self.before.off_by:.3f} "
            f"before and {self.after.off_by:.3f} after (Brier score {self.before.brier.mean:.3f} "
            f"and {self.after.brier.mean:.3f}); one demonstration brings at most "
            f"{self.map.largest_gain:.2f} nat"
        )


def calibrate(
    model: TabularModel,
    tasks: Sequence[Task | Demonstration],
    *,
    hypotheses: ArrayLike | None = None,
    trials: int = 200,
    seed: int = 0,
    exact_ends: bool = True,
    restarts: int = 3,
    iterations: int = 10,
    goal_weight: float = 300.0,
    goal_tolerance: float = REACHED,
    wind: bool = True,
    limit: Box | None = None,
    crossing: Crossing = ANY,
    n_jobs: int = 1,
    progress: Progress | None = None,
) -> Calibration:
    """Calibrate the forecasts of a model by simulated demonstrations without a constraint.

    It is assumed that people move like the demonstrator, who maximises the system's running reward
    (`mlci.demonstrator.demonstrate`, with at least 100 Runge-Kutta steps a task).

    Args:
        model: the tabular model.
        tasks: tasks, or demonstrations of them; the trials' tasks are drawn from a smooth
            distribution through them, see `similar_tasks`.
        hypotheses: (C,) mask over the model's regions; None takes all.
        trials: tasks that are tried.
        seed: of tasks and first guesses.
        exact_ends: as of `mlci.preparation.infer`; the map belongs to evidence of the same kind.
        restarts: first guesses of a trial.
        iterations: as of `demonstrate`.
        goal_weight: as of `demonstrate`.
        goal_tolerance: as of `demonstrate`.
        wind: as of `demonstrate`.
        limit: as of `demonstrate`.
        crossing: as of `mlci.preparation.infer`.
        n_jobs: tasks that are worked on at once; -1 is one a core. The result is the same.
        progress: called with how many tasks are done, and of how many.

    Raises:
        ValueError: no task, or a start outside the state space.
    """
    plain = [each.task if isinstance(each, Demonstration) else each for each in tasks]
    rng = np.random.default_rng(seed)
    drawn = similar_tasks(model.grid.space, plain, trials, rng)
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
            model.system,
            tried,
            None,
            None,
            dt=model.dt / pieces,
            goal_weight=goal_weight,
            iterations=iterations,
            goal_tolerance=goal_tolerance,
            wind=wind,
            limit=limit,
            integrator=RK4,
        )
        paths += [a.demonstration for a in attempts if a.outcome is Outcome.KEPT]
    order = rng.permutation(len(paths))  # so that both halves have tasks of all durations
    return calibrate_on(
        model,
        [paths[i] for i in order],
        tried=trials,
        hypotheses=hypotheses,
        exact_ends=exact_ends,
        crossing=crossing,
        n_jobs=n_jobs,
        progress=progress,
    )


def calibrate_on(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    *,
    tried: int | None = None,
    hypotheses: ArrayLike | None = None,
    exact_ends: bool = True,
    crossing: Crossing = ANY,
    n_jobs: int = 1,
    progress: Progress | None = None,
) -> Calibration:
    """Calibrate the forecasts of a model by demonstrations of agents whom nothing constrains.

    Args:
        model: the tabular model.
        demonstrations: of tasks in random order: the first half fits, the second is judged.
        tried: how many tasks were tried; by default as many as there are demonstrations.
        hypotheses: (C,) mask over the model's regions; None takes all.
        exact_ends: as of `mlci.preparation.infer`.
        crossing: as of `mlci.preparation.infer`.
        n_jobs: tasks that are worked on at once.
        progress: called with how many tasks are done, and of how many.

    Raises:
        ValueError: as of `mlci.preparation.prepare`.
    """
    tried, count = len(demonstrations) if tried is None else tried, len(model.regions)
    mask = as_mask(hypotheses, count)
    regions = model.regions.select(mask)
    tasks = [demonstration.task for demonstration in demonstrations]
    prepared = prepare(
        model, tasks, hypotheses=mask, exact_ends=exact_ends, n_jobs=n_jobs, progress=progress
    )
    can, sizes = prepared.reachable, region_sizes(regions)
    used, half = int(np.sum(can)), int(np.sum(can)) // 2
    if used < FEWEST:
        return Calibration(tried, used)
    alpha = prepared.avoidance[can]
    paths = [each.states for each in demonstrations]
    times = [each.times for each in demonstrations]
    hits = crossed(regions, paths, times, crossing)[can]
    open_pairs = ~(certain_by_ends(regions, tasks) | prepared.decided_by_cell)[can]
    counts = open_pairs & is_possible(alpha)
    if not (counts[:half].any() and counts[half:].any()):
        return Calibration(tried, used)
    first = fit_map(alpha[:half], hits[:half], sizes, counts[:half])
    calibrated = first.avoidance(alpha[half:], sizes)
    beyond = open_pairs & ~counts
    return Calibration(
        tried,
        used,
        fit_map(alpha, hits, sizes, counts),
        score_forecasts(alpha[half:], hits[half:], counts[half:]),
        score_forecasts(calibrated, hits[half:], counts[half:]),
        float(np.mean(hits[beyond])) if beyond.any() else None,
    )


def certain_by_ends(regions: Regions, tasks: Sequence[Task]) -> Bools:
    """Which regions (N, C) a task's ends lie in: the start, or a goal that is entirely inside."""
    bounds = regions.space.bounds
    starts = np.array([task.start for task in tasks]).reshape(-1, 1, bounds.dimension)
    goals = [
        Box(np.maximum(task.goal.lower, bounds.lower), np.minimum(task.goal.upper, bounds.upper))
        if not np.all(np.isfinite(task.goal.widths))
        else task.goal
        for task in tasks
    ]
    corners = np.array([goal.vertices()[:, None] for goal in goals])
    return regions.violated_by(starts) | np.all(regions.violated_by(corners), axis=1)


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
