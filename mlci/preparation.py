"""From a model and demonstrations to an `Inference`, in one step or in two.

All that takes time depends on the tasks alone: starts, goals and durations. So `prepare` can do it
before anybody moves, as section IV-C says; what is left when demonstrations arrive is to see which
hypotheses they violate, and to rank the others. `infer` does both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.crossings import ANY, Crossing, crossed
from mlci.demonstrations import REACHED, Demonstration, Task, departures
from mlci.evidence import DEFAULT_MODEL_ERROR, Rates
from mlci.forecasts import ForecastMap
from mlci.inference import Inference
from mlci.models import Forecast, Model, forecasters
from mlci.regions import Regions, as_mask
from mlci.sampling_errors import SamplingErrors
from mlci.spaces import Bools, Floats
from mlci.tabular import Progress


@dataclass(frozen=True, eq=False)
class PreparedInference:
    """What the ranking needs of N tasks that are known before anybody moves; made by `prepare`.

    Attributes:
        tasks: the N tasks.
        hypotheses: the C hypotheses.
        avoidance: (N, C) probability that the unconstrained agent avoids a hypothesis; 1 where it
            says nothing.
        reachable: (N,) whether the model can do the task.
        decided_by_cell: (N, C) pairs that are no evidence, see `mlci.evidence.decided_by_cell`;
            none where trajectories begin and end at cells.
        sampling: how far `avoidance` may be off; None where nothing is sampled.

    Raises:
        ValueError: shapes that disagree.
    """

    tasks: tuple[Task, ...]
    hypotheses: Regions
    avoidance: Floats
    reachable: Bools
    decided_by_cell: Bools
    sampling: SamplingErrors | None = None

    def __post_init__(self) -> None:
        shape = len(self.tasks), len(self.hypotheses)
        if (
            not self.avoidance.shape
            == self.decided_by_cell.shape
            == shape
            == (
                *self.reachable.shape,
                shape[1],
            )
        ):
            raise ValueError(
                f"avoidance {self.avoidance.shape}, reachable {self.reachable.shape} and "
                f"decided_by_cell {self.decided_by_cell.shape} do not fit {shape[0]} tasks and "
                f"{shape[1]} hypotheses"
            )

    def infer(
        self,
        paths: Sequence[ArrayLike],
        dt: ArrayLike,
        tasks: Sequence[int] | None = None,
        *,
        names: Sequence[str] = (),
        prior_none: float = 0.5,
        rates: Rates | None = None,
        calibration: ForecastMap | None = None,
        tolerance: float = REACHED,
        crossing: Crossing = ANY,
        size_prior: float = 0.0,
    ) -> Inference:
        """Rank the hypotheses by the demonstrations that have arrived, equations (4) to (6).

        Args:
            paths: states (K+1, n) of each demonstration.
            dt: time between samples [s], of all paths or (N,) of each; the mean where it varies,
                as only the duration counts.
            tasks: the number of each demonstration's task, in any order and as often as it was
                done; by default each task was done once, in order.
            names: of the demonstrations; their numbers by default.
            prior_none: prior probability that there is no constraint.
            rates: as of `infer`.
            calibration: as of `infer`.
            tolerance: how far a path may start from its task's start and end from its goal,
                Euclidean in raw units.
            crossing: what counts as entering a hypothesis; a touch by default.
            size_prior: as of `infer`.

        Raises:
            ValueError: a task that is not known, not one task and name for each path, or a path
                whose start, end or duration is not that of its task.
        """
        numbers = np.arange(len(self.tasks)) if tasks is None else np.asarray(tasks, dtype=np.int64)
        labels = tuple(names) or tuple(map(str, range(len(paths))))
        if numbers.shape != (len(paths),) or len(labels) != len(paths):
            raise ValueError(
                f"{len(paths)} paths need as many tasks and names, not {numbers.tolist()} and "
                f"{list(labels)}"
            )
        if np.any((numbers < 0) | (numbers >= len(self.tasks))):
            raise ValueError(
                f"tasks are numbered 0 to {len(self.tasks) - 1}, not {numbers.tolist()}"
            )
        steps = np.broadcast_to(np.asarray(dt, dtype=float), numbers.shape)
        paths = [
            self._path(path, float(step), number, name, tolerance)
            for path, step, number, name in zip(paths, steps, numbers.tolist(), labels, strict=True)
        ]
        default = Rates(DEFAULT_MODEL_ERROR if calibration is None else 0.0)
        return Inference(
            self.hypotheses,
            labels,
            self.avoidance[numbers],
            _violations(self.hypotheses, paths, steps, crossing),
            self.reachable[numbers],
            prior_none,
            default if rates is None else rates,
            calibration,
            decided_by_cell=self.decided_by_cell[numbers],
            crossing=crossing,
            sampling=self.sampling and self.sampling.of(numbers),
            size_prior=size_prior,
        )

    def _path(self, path: ArrayLike, dt: float, number: int, name: str, tolerance: float) -> Floats:
        """A path (K+1, n), checked to be of a task by its number."""
        space, states = self.hypotheses.space, np.asarray(path, dtype=float)
        if states.ndim != 2 or len(states) < 2 or states.shape[1] != space.dimension:
            raise ValueError(
                f"path {name!r} needs states of shape (K+1, {space.dimension}) with K >= 1, not "
                f"{states.shape}"
            )
        if not np.all(np.isfinite(states)):
            raise ValueError(f"path {name!r} has states that are not finite")
        duration = (len(states) - 1) * dt
        if phrases := departures(self.tasks[number], states, duration, space, tolerance):
            raise ValueError(f"path {name!r} does not do task {number}: {'; '.join(phrases)}")
        return states


def infer(
    model: Model,
    demonstrations: Sequence[Demonstration],
    *,
    hypotheses: ArrayLike | None = None,
    prior_none: float = 0.5,
    rates: Rates | None = None,
    calibration: ForecastMap | None = None,
    round_horizon: bool = False,
    exact_ends: bool = True,
    tolerance: float = REACHED,
    crossing: Crossing = ANY,
    size_prior: float = 0.0,
    n_jobs: int = 1,
    progress: Progress | None = None,
) -> Inference:
    """Rank hypotheses by demonstrations, equations (4) to (6).

    Args:
        model: a tabular model, or one that samples paths.
        demonstrations: N demonstrations, each with a task of its own.
        hypotheses: (C,) mask over the model's regions; None takes all.
        prior_none: prior probability that there is no constraint.
        rates: model error and rule breaking of the demonstrators; None takes no rule breaking, and
            the default model error, or none with a calibration.
        calibration: what maps probabilities of the model to what simulated demonstrators do; see
            `mlci.calibration.calibrate`.
        round_horizon: take the nearest number of time steps where dt does not divide a duration.
        exact_ends: let trajectories begin and end at states, so that a region is not certain to be
            entered only because it holds a cell's centre. The paper's begin and end at cells.
        tolerance: how far a demonstration may end from its task's goal, Euclidean in raw units.
        crossing: what counts as entering a hypothesis; a touch by default.
        size_prior: prior weights are sizes to the power of minus this, see `mlci.region_sizes`.
        n_jobs: tasks that are worked on at once; -1 is one a core. The result is the same.
        progress: called with how many tasks are done, and of how many.

    Raises:
        ValueError: a start outside the state space, a duration that dt does not divide, a mask of
            the wrong shape, or a demonstration that does not end at its task's goal.
    """
    prepared = prepare(
        model,
        [demonstration.task for demonstration in demonstrations],
        hypotheses=hypotheses,
        round_horizon=round_horizon,
        exact_ends=exact_ends,
        n_jobs=n_jobs,
        progress=progress,
    )
    paths = [demonstration.states for demonstration in demonstrations]
    names = [
        demonstration.name or str(number) for number, demonstration in enumerate(demonstrations)
    ]
    return prepared.infer(
        paths,
        [each.times[-1] / (len(each.states) - 1) for each in demonstrations],
        names=names,
        prior_none=prior_none,
        rates=rates,
        calibration=calibration,
        tolerance=tolerance,
        crossing=crossing,
        size_prior=size_prior,
    )


def prepare(
    model: Model,
    tasks: Sequence[Task],
    *,
    hypotheses: ArrayLike | None = None,
    round_horizon: bool = False,
    exact_ends: bool = True,
    n_jobs: int = 1,
    progress: Progress | None = None,
) -> PreparedInference:
    """Do beforehand whatever of the inference depends on the tasks alone; arguments as of `infer`.

    Raises:
        ValueError: as of `infer`.
    """
    mask = as_mask(hypotheses, len(model.regions))
    works = forecasters(model, tasks, round_horizon=round_horizon, exact_ends=exact_ends)
    from joblib import Parallel, delayed

    # Threads, as machine code does the work.
    results = Parallel(n_jobs=n_jobs, prefer="threads", return_as="generator")(
        delayed(work)() for work in works
    )
    found: list[Forecast] = []
    for forecast in results:
        found.append(forecast)
        if progress is not None:
            progress(len(found), len(tasks))
    shape = len(found), len(model.regions)
    parts = [each.sampling for each in found if each.sampling is not None]
    return PreparedInference(
        tuple(tasks),
        model.regions.select(mask),
        np.reshape([each.avoidance for each in found], shape)[:, mask],
        np.array([each.possible for each in found], dtype=bool),
        np.array([each.decided for each in found], dtype=bool).reshape(shape)[:, mask],
        SamplingErrors.joined(parts).select(mask) if parts else None,
    )


def _violations(
    hypotheses: Regions, paths: Sequence[ArrayLike], dt: Floats, crossing: Crossing
) -> Bools:
    """D (N, C): which hypotheses each path violates."""
    violated = np.zeros((len(paths), len(hypotheses)), dtype=bool)
    if not crossing.is_any:
        times = [
            step * np.arange(len(np.asarray(path))) for path, step in zip(paths, dt, strict=True)
        ]
        violated[:] = crossed(hypotheses, paths, times, crossing)
    elif len({np.shape(path) for path in paths}) == 1:  # all at once is quicker
        violated[:] = hypotheses.violated_by(np.stack(paths))
    else:
        for row, path in zip(violated, paths, strict=True):
            row[:] = hypotheses.violated_by(path)
    return violated
