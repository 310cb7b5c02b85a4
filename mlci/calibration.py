"""How often Phi comes true, by simulation: the map that calibrates evidence, and how good it is.

Nobody knows how recorded people would move if nothing were forbidden, but a simulated demonstrator
can be let go. `calibrate` lets it do tasks like the recorded ones without a constraint, and sees
which regions it crosses, against what the tabular model forecasts. One half of the tasks fits a
map, by which the other half is judged; the map that is used is fitted on both.

What this assumes is that people move like the demonstrator: as far as they do not, evidence is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from mlci.crossings import ANY, Crossing, crossed
from mlci.demonstrations import REACHED, Demonstration, Task
from mlci.forecast_scores import ForecastScores, score_forecasts
from mlci.forecasts import ForecastMap, fit_map, is_possible
from mlci.misfit import excess_of
from mlci.models import Model
from mlci.preparation import prepare
from mlci.region_sizes import region_sizes
from mlci.regions import Regions, as_mask
from mlci.similar_tasks import similar_demonstrations
from mlci.spaces import Bools, Box, Floats
from mlci.tabular import Progress

FEWEST = 20  # demonstrations from which a map can be fitted and judged


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
        excess: (used,) by how much the violation distance (11) of each demonstration is above its
            floor, see `mlci.misfit`.
    """

    tried: int
    used: int
    map: ForecastMap | None = None
    before: ForecastScores | None = None
    after: ForecastScores | None = None
    out_of_reach: float | None = None
    excess: Floats = field(default_factory=lambda: np.zeros(0))

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
            f"{self.map.largest_gain:.2f} nat for a region"
        )


def calibrate(
    model: Model,
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
        model: the model.
        tasks: tasks, or demonstrations of them; the trials' tasks are drawn from a smooth
            distribution through them, see `mlci.similar_tasks`.
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
    rng = np.random.default_rng(seed)
    paths = similar_demonstrations(
        model,
        tasks,
        trials,
        rng,
        restarts=restarts,
        iterations=iterations,
        goal_weight=goal_weight,
        goal_tolerance=goal_tolerance,
        wind=wind,
        limit=limit,
    )
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
    model: Model,
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
        model: the model.
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
    excess = excess_of(1 - alpha, hits)
    open_pairs = ~(certain_by_ends(regions, tasks) | prepared.decided_by_cell)[can]
    counts = open_pairs & is_possible(alpha)
    if not (counts[:half].any() and counts[half:].any()):
        return Calibration(tried, used, excess=excess)
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
        excess,
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
