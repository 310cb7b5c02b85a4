"""What to record next: the tasks whose demonstrations are expected to teach most.

Candidates are judged by the expected drop of the posterior's entropy (`mlci.task_outcomes`). The
tasks of a batch are chosen one after the other. Each is judged over beliefs as they may be once
those before it are recorded, so that no two of them tell the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # loads scipy.special when it is first used
from numpy.typing import ArrayLike

from mlci.calibration import certain_by_ends
from mlci.demonstrations import Task
from mlci.inference import Inference
from mlci.json_numbers import finite
from mlci.misfit import sample_crossings
from mlci.models import Model, distributions_of, forecast_of, rough_model
from mlci.regions import as_mask
from mlci.spaces import Floats, StateSpace
from mlci.tabular import Progress
from mlci.task_outcomes import TaskOutcomes, as_forecast, task_outcomes

SAMPLES = 500  # trajectories drawn for each task
_IMPLAUSIBLE = 1e-3  # of the posterior: truths that hold no more together are left out
_FUTURES = 64  # outcomes of the tasks chosen so far, over which the next one of a batch is judged
_CLOSER = 3  # times as many tasks as are named are looked at again, after a glance at all
_ALIKE = 0.1  # of a dimension's range: tasks whose ends differ by less are nearly the same


@dataclass(frozen=True, eq=False)
class NextTask:
    """A task that is worth recording.

    Attributes:
        task: the task.
        number: which of the candidates it is.
        name: what the candidate is called.
        information: expected drop of the posterior's entropy by a demonstration of it [nat], beyond
            that by the tasks before it in a batch.
        error: standard error of `information` by its trajectories, for a first task [nat].
        chance: probability that a demonstration of it alone moves a tenth of the posterior or more.
    """

    task: Task
    number: int
    name: str
    information: float
    error: float
    chance: float

    def record(self, space: StateSpace) -> dict[str, Any]:
        """The same for programs, fit for JSON; a side of a goal that is free is None."""
        goal = self.task.goal
        lower, upper = (
            {name: finite(end) for name, end in zip(space.names, side, strict=True)}
            for side in (goal.lower, goal.upper)
        )
        return {
            "name": self.name,
            "start": dict(zip(space.names, self.task.start.tolist(), strict=True)),
            "goal": {"lower": lower, "upper": upper},
            "horizon": self.task.horizon,
            "information": self.information,
            "error": self.error,
            "chance": self.chance,
        }


def simulate_tasks(
    model: Model,
    inference: Inference,
    tasks: Sequence[Task],
    *,
    hypotheses: ArrayLike | None = None,
    samples: int = SAMPLES,
    seed: int = 0,
    round_horizon: bool = False,
    exact_ends: bool = True,
    progress: Progress | None = None,
) -> list[TaskOutcomes | None]:
    """What demonstrations of each task may show; None where the model cannot do it.

    A region that holds a task's start or goal counts for nothing there: whoever keeps out of it
    would not do the task, and nobody should be asked to.

    Args:
        model: the model.
        inference: its hypotheses, rates and calibration say what counts as evidence.
        tasks: the tasks.
        hypotheses: as of `mlci.preparation.infer`, for the inference.
        samples: trajectories drawn for each task.
        seed: of these; task j depends on it and on j only.
        round_horizon: as of `infer`.
        exact_ends: as of `infer`.
        progress: called with how many tasks are done, and of how many.

    Raises:
        ValueError: no samples, or as of `mlci.preparation.prepare`.
    """
    if samples < 1:
        raise ValueError(f"at least one trajectory is drawn for each task, not {samples}")
    mask, eta = as_mask(hypotheses, len(model.regions)), inference.rates.model_error
    simulated: list[TaskOutcomes | None] = []
    distributions = distributions_of(
        model, tasks, round_horizon=round_horizon, exact_ends=exact_ends
    )
    for number, (task, distribution) in enumerate(zip(tasks, distributions, strict=True)):
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
        of_task = forecast_of(distribution)
        if of_task.possible:
            alpha = of_task.avoidance[None, mask]
            decided = of_task.decided[None, mask] | certain_by_ends(inference.hypotheses, [task])
            forecast = inference.forecast_of(alpha, decided)[0]
            violated = as_forecast(
                sample_crossings(distribution, samples, rng)[:, mask],
                alpha[0],
                (1 - eta) * forecast + eta,
                rng,
            )
            simulated.append(task_outcomes(violated, inference.rates))
        else:
            simulated.append(None)
        if progress is not None:
            progress(number + 1, len(tasks))
    return simulated


def next_tasks(
    model: Model,
    inference: Inference,
    tasks: Sequence[Task],
    *,
    count: int = 3,
    names: Sequence[str] = (),
    hypotheses: ArrayLike | None = None,
    samples: int = SAMPLES,
    seed: int = 0,
    round_horizon: bool = False,
    exact_ends: bool = True,
    progress: Progress | None = None,
) -> list[NextTask]:
    """The tasks to record next, one after the other by what each adds to those before it.

    What is assumed: at most one region is forbidden, and people move like the model, as far as
    rates and calibration say.

    Args:
        model: the model.
        inference: what is believed.
        tasks: the candidates; those that the model cannot do, or that are nearly one of the chosen,
            are passed over.
        count: of tasks, at most.
        names: of the candidates; their numbers by default.
        hypotheses: as of `simulate_tasks`, as are the others.
        samples: likewise.
        seed: likewise.
        round_horizon: likewise.
        exact_ends: likewise.
        progress: likewise.

    Raises:
        ValueError: a count below 0, or as of `simulate_tasks`.
    """
    if count < 0:
        raise ValueError(f"tasks that are named are counted from 0 up, not {count}")

    def simulated(by: Model, numbers: Sequence[int]) -> dict[int, TaskOutcomes]:
        """Outcomes of some tasks, by their numbers, but for those that a model cannot do."""
        found = simulate_tasks(
            by,
            inference,
            [tasks[number] for number in numbers],
            hypotheses=hypotheses,
            samples=samples,
            seed=seed,
            round_horizon=round_horizon,
            exact_ends=exact_ends,
            progress=progress,
        )
        pairs = zip(numbers, found, strict=True)
        return {number: of_task for number, of_task in pairs if of_task is not None}

    belief = plausible(np.append(inference.posterior, inference.posterior_none))
    numbers, rough = list(range(len(tasks))), rough_model(model)
    if rough is not model and len(tasks) > _CLOSER * count:
        glance = simulated(rough, numbers)
        worth = {number: float(each.information(belief)) for number, each in glance.items()}
        numbers = sorted(worth, key=worth.__getitem__, reverse=True)[: _CLOSER * count]
    outcomes = simulated(model, numbers)
    beliefs, chosen = belief[None, :], list[NextTask]()
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(len(tasks),)))
    while outcomes and len(chosen) < count:
        expected = {
            number: float(np.mean(of_task.information(beliefs)))
            for number, of_task in outcomes.items()
        }
        best = max(expected, key=expected.__getitem__)
        task, of_best = tasks[best], outcomes[best]
        information, error, chance = expected[best], of_best.error(belief), of_best.chance(belief)
        name = names[best] if names else str(best)
        chosen.append(NextTask(task, best, name, information, error, chance))
        futures = np.repeat(beliefs, _FUTURES, axis=0) if len(beliefs) == 1 else beliefs
        beliefs = of_best.learnt(futures, rng)
        space = model.regions.space
        outcomes = {
            number: of_task
            for number, of_task in outcomes.items()
            if not nearly_the_same(space, task, tasks[number])
        }
    return chosen


def plausible(belief: Floats) -> Floats:
    """A belief (C+1,) without its least probable truths, which hold a thousandth together."""
    order = np.argsort(belief, kind="stable")
    small = order[np.cumsum(belief[order]) <= _IMPLAUSIBLE]
    kept = np.where(np.isin(np.arange(len(belief)), small), 0.0, belief)
    return np.asarray(kept / np.sum(kept))


def entropy(belief: Floats) -> float:
    """Entropy [nat] of a belief (C+1,): what demonstrations can still tell."""
    return float(-np.sum(scipy.special.xlogy(belief, belief)))


def nearly_the_same(space: StateSpace, one: Task, other: Task) -> bool:
    """Whether starts, and goals, differ by less than a tenth of each dimension's range."""
    bounded = np.isfinite(one.goal.lower)
    if not np.array_equal(bounded, np.isfinite(other.goal.lower)):
        return False
    ends = np.array(
        [
            [
                each.start,
                *(np.where(bounded, side, 0.0) for side in (each.goal.lower, each.goal.upper)),
            ]
            for each in (one, other)
        ]
    )
    apart = np.abs(space.difference(ends[0], ends[1])) / space.bounds.widths
    return bool(np.max(apart) < _ALIKE)
