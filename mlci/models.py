"""What inference needs of a model, whether it has cells or samples paths.

For each task that is how probable it is to avoid each region, and how surely that is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial, singledispatch

import numpy as np

from mlci.cells.refined_model import RefinedModel
from mlci.demonstrations import Task
from mlci.evidence import decided_by_cell
from mlci.maxent import TrajectoryDistribution
from mlci.sampled.distribution import SampledDistribution
from mlci.sampled.model import SampledModel
from mlci.sampling_errors import SamplingErrors
from mlci.spaces import Bools, Floats
from mlci.tabular import TabularModel

Model = TabularModel | SampledModel | RefinedModel
_ROUGH_SAMPLES, _ROUGH_RESTARTS = 300, 2  # of a first look
NO_CELLS_AT_ENDS = "a sampled model has no cells: its trajectories begin and end at states"


@dataclass(frozen=True, eq=False)
class Forecast:
    """What a model says of a task.

    Attributes:
        possible: whether the model can do it.
        avoidance: (C,) alpha, the probability of avoiding each region; 1 if it is not possible.
        decided: (C,) what only a cell decides, see `mlci.evidence.decided_by_cell`.
        sampling: how far alpha may be off, of one task; None where nothing is sampled.
    """

    possible: bool
    avoidance: Floats
    decided: Bools
    sampling: SamplingErrors | None = None


Distribution = TrajectoryDistribution | SampledDistribution


@singledispatch
def distribution_of(
    model: Model, task: Task, *, round_horizon: bool = False, exact_ends: bool = True
) -> Distribution:
    """The distribution of a task; arguments and errors as of `forecasters`."""
    raise TypeError(f"a TabularModel or a SampledModel tells of tasks, not {type(model).__name__}")


@distribution_of.register
def _tabular_distribution(
    model: TabularModel, task: Task, *, round_horizon: bool = False, exact_ends: bool = True
) -> Distribution:
    return TrajectoryDistribution.of_task(
        model, task, round_horizon=round_horizon, exact_ends=exact_ends
    )


@distribution_of.register
def _sampled_distribution(
    model: SampledModel, task: Task, *, round_horizon: bool = False, exact_ends: bool = True
) -> Distribution:
    if not exact_ends:
        raise ValueError(NO_CELLS_AT_ENDS)
    return model.distribution(task, round_horizon=round_horizon)


@distribution_of.register
def _refined_distribution(
    model: RefinedModel, task: Task, *, round_horizon: bool = False, exact_ends: bool = True
) -> Distribution:
    return model.distribution(task, round_horizon=round_horizon, exact_ends=exact_ends)


@singledispatch
def distributions_of(
    model: Model, tasks: Sequence[Task], *, round_horizon: bool = False, exact_ends: bool = True
) -> Iterator[Distribution]:
    """The distribution of each task, in order; arguments and errors as of `forecasters`."""
    for task in tasks:
        yield distribution_of(model, task, round_horizon=round_horizon, exact_ends=exact_ends)


@distributions_of.register
def _sampled_distributions(
    model: SampledModel,
    tasks: Sequence[Task],
    *,
    round_horizon: bool = False,
    exact_ends: bool = True,
) -> Iterator[Distribution]:
    if not exact_ends:
        raise ValueError(NO_CELLS_AT_ENDS)
    return model.distributions(tasks, round_horizon=round_horizon)


@singledispatch
def rough_model(model: Model) -> Model:
    """A model that takes less time, for a first look at many tasks; the same if there is none."""
    return model


@rough_model.register
def _with_few_samples(model: SampledModel) -> Model:
    few = min(model.samples, _ROUGH_SAMPLES), min(model.restarts, _ROUGH_RESTARTS)
    return replace(model, samples=few[0], restarts=few[1])


@singledispatch
def forecasters(
    model: Model, tasks: Sequence[Task], *, round_horizon: bool, exact_ends: bool
) -> list[Callable[[], Forecast]]:
    """A function for each task that does the work and returns its forecast.

    Args:
        model: the model.
        tasks: the tasks, which are checked at once.
        round_horizon: take the nearest number of time steps where dt does not divide a duration.
        exact_ends: let trajectories begin and end at states, not at cells.

    Raises:
        ValueError: a task that the model cannot describe.
        TypeError: something that is no model.
    """
    raise TypeError(f"a TabularModel or a SampledModel tells of tasks, not {type(model).__name__}")


@forecasters.register
def _of_cells(
    model: TabularModel, tasks: Sequence[Task], *, round_horizon: bool, exact_ends: bool
) -> list[Callable[[], Forecast]]:
    distributions = [
        TrajectoryDistribution.of_task(
            model, task, round_horizon=round_horizon, exact_ends=exact_ends
        )
        for task in tasks
    ]
    if tasks:
        _ = model.merged  # once for all tasks
    return [partial(forecast_of, distribution) for distribution in distributions]


@forecasters.register
def _of_refined_cells(
    model: RefinedModel, tasks: Sequence[Task], *, round_horizon: bool, exact_ends: bool
) -> list[Callable[[], Forecast]]:
    ends = {"round_horizon": round_horizon, "exact_ends": exact_ends}
    for task in tasks:
        TrajectoryDistribution.of_task(model.model, task, **ends)
    return [partial(_refined_forecast, model, task, **ends) for task in tasks]


def _refined_forecast(model: RefinedModel, task: Task, **ends: bool) -> Forecast:
    """The forecast of a task on its own cells."""
    return forecast_of(distribution_of(model, task, **ends))


@forecasters.register
def _of_samples(
    model: SampledModel, tasks: Sequence[Task], *, round_horizon: bool, exact_ends: bool
) -> list[Callable[[], Forecast]]:
    if not exact_ends:
        raise ValueError(NO_CELLS_AT_ENDS)
    for task in tasks:
        model.passage(task, round_horizon=round_horizon)

    def forecast(task: Task) -> Forecast:
        distribution = model.distribution(task, round_horizon=round_horizon)
        return forecast_of(distribution, model.replicates)

    return [partial(forecast, task) for task in tasks]


@singledispatch
def forecast_of(distribution: Distribution, replicates: int = 0) -> Forecast:
    """The forecast of a task by its distribution.

    Args:
        distribution: of the task.
        replicates: of probabilities that are sampled.
    """
    raise TypeError(f"a {type(distribution).__name__} is no distribution of a task")


@forecast_of.register
def _tabular_forecast(distribution: TrajectoryDistribution, replicates: int = 0) -> Forecast:
    count = len(distribution.model.regions)
    nothing = np.zeros(count, dtype=bool)
    if not distribution.is_possible:
        return Forecast(False, np.ones(count), nothing)
    avoidance = distribution.avoidance_probabilities()
    between_cells = replace(distribution, ends=None)
    if distribution.ends is not None and between_cells.is_possible:
        nothing = decided_by_cell(between_cells.avoidance_probabilities(), avoidance)
    return Forecast(True, avoidance, nothing)


@forecast_of.register
def _sampled_forecast(distribution: SampledDistribution, replicates: int = 0) -> Forecast:
    count, diagnosis = len(distribution.regions), distribution.diagnosis
    nothing, complaints = np.zeros(count, dtype=bool), (tuple(diagnosis.complaints),)
    effective = np.array([diagnosis.effective])
    if not distribution.is_possible:
        certain = np.ones((replicates, 1, count))
        of_none = SamplingErrors(np.zeros((1, count)), certain, complaints, effective)
        return Forecast(False, np.ones(count), nothing, of_none)
    errors = distribution.avoidance_errors()[None]
    moved = distribution.avoidance_replicates(replicates)[:, None]
    sampling = SamplingErrors(errors, moved, complaints, effective)
    # Nothing is unavoidable only because no sample avoids it.
    alpha = np.maximum(distribution.avoidance_probabilities(), distribution.least)
    return Forecast(True, alpha, nothing, sampling)
