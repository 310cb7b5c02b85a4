"""Second step of a point: the paper's measures, under the truth (section V)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.streams import Purpose, stream
from mlci.cells.refined_model import RefinedModel
from mlci.demonstrations import Demonstration
from mlci.maxent import TrajectoryDistribution
from mlci.metrics import final_state_error, violation_distance
from mlci.models import Model, distribution_of
from mlci.sampled.model import SampledModel
from mlci.simulate import rollout
from mlci.spaces import Bools, Floats, Ints
from mlci.systems import System
from mlci.tabular import TabularModel

_FEWEST_EFFECTIVE = 20  # samples that avoid the truth, from which a task counts as feasible


@dataclass(frozen=True, eq=False)
class Measures:
    """What the model does under the truth, for each of N demonstrations.

    Attributes:
        feasible: (N,) whether it can do the task; NaN stands in the others' measures. None if
            `rollouts` is 0, where nothing is measured.
        phi: (N, C) probability that it violates a hypothesis; 0 where not feasible.
        final_state_error: (N,) mean over sampled trajectories, the measure of Fig. 3.
        violation_distance: (N,) equation (11) for each demonstration alone.
        violation_floor: (N,) what that is on average for the model's own trajectories.
        violation_share: (N,) what each demonstration adds to the pooled distance.
        trajectories: cells (T+1,) and moves (T,) of one sampled trajectory, by trial.
    """

    feasible: Bools
    phi: Floats
    final_state_error: Floats
    violation_distance: Floats
    violation_floor: Floats
    violation_share: Floats
    trajectories: Mapping[int, tuple[Ints, Ints]]


@dataclass(frozen=True, eq=False)
class _UnderTruth:
    """What a model does under the truth, of N tasks.

    Attributes:
        feasible: (N,) whether it can do each.
        phi: (F, C') probability that it violates each of its regions, of the feasible ones.
        error: (F,) mean final-state error of sampled trajectories.
        trajectories: as of `Measures`; none without cells that all tasks share.
    """

    feasible: Bools
    phi: Floats
    error: Floats
    trajectories: Mapping[int, tuple[Ints, Ints]]


def measure_point(settings: Settings, point: PointInference) -> Measures:
    """Let the model do the tasks under the truth, and measure it."""
    inference, count = point.inference, len(point.demonstrations)
    feasible, phi = np.zeros(count, dtype=bool), np.zeros(inference.phi.shape)
    error, distance, floor, share = np.full((4, count), np.nan)
    if settings.rollouts == 0:
        return Measures(feasible, phi, error, distance, floor, share, {})
    done = _under_truth(point.model, settings, point)
    feasible = done.feasible
    if feasible.any():
        phi[feasible], error[feasible] = done.phi[:, point.hypotheses], done.error
        violations = violation_distance(phi[feasible], inference.violated[feasible])
        distance[feasible], floor[feasible] = violations.each, violations.floor
        share[feasible] = violations.shares
    return Measures(feasible, phi, error, distance, floor, share, done.trajectories)


@singledispatch
def _under_truth(model: Model, settings: Settings, point: PointInference) -> _UnderTruth:
    """Let a model do a point's tasks under the truth."""
    raise TypeError(f"a {type(model).__name__} is no model")


@_under_truth.register
def _of_cells(
    model: TabularModel | RefinedModel, settings: Settings, point: PointInference
) -> _UnderTruth:
    model = model.under(point.truth)
    feasible = np.zeros(len(point.demonstrations), dtype=bool)
    phi, trajectories, controls, done = [], {}, [], []
    for j, demonstration in enumerate(point.demonstrations):
        distribution = distribution_of(model, demonstration.task, exact_ends=False)
        assert isinstance(distribution, TrajectoryDistribution)  # there are cells
        if not distribution.is_possible:
            continue
        feasible[j] = True
        phi.append(distribution.violation_probabilities())
        number = int(point.numbers[j])
        cells, moves = distribution.sample(
            settings.rollouts, stream(settings.seed, Purpose.ROLLOUTS, number)
        )
        if isinstance(model, TabularModel):
            trajectories[number] = cells[0], moves[0]
        controls.append(distribution.model.actions[distribution.model.action[moves]])
        done.append(demonstration)
    error = np.zeros(0)
    if done:
        error = rollout_errors(
            model.system, done, np.stack(controls), model.dt, settings.demonstrations.dt
        )
    return _UnderTruth(feasible, np.array(phi), error, trajectories)


@_under_truth.register
def _of_samples(model: SampledModel, settings: Settings, point: PointInference) -> _UnderTruth:
    feasible = np.zeros(len(point.demonstrations), dtype=bool)
    model = model.under(point.truth)
    phi, error = [], []
    for j, demonstration in enumerate(point.demonstrations):
        distribution = model.distribution(demonstration.task)
        if distribution.diagnosis.effective < _FEWEST_EFFECTIVE:
            continue
        feasible[j] = True
        phi.append(distribution.violation_probabilities())
        rng = stream(settings.seed, Purpose.ROLLOUTS, int(point.numbers[j]))
        final = distribution.sample(settings.rollouts, rng)[:, -1]
        goal = demonstration.task.goal
        error.append(np.mean(final_state_error(model.system.space, final, goal)))
    return _UnderTruth(feasible, np.array(phi), np.array(error), {})


def rollout_errors(
    system: System,
    demonstrations: Sequence[Demonstration],
    controls: Floats,
    dt: float,
    substep: float,
) -> Floats:
    """(N,) mean final-state error of sampled controls on the continuous system (Fig. 3).

    Args:
        system: the continuous system.
        demonstrations: N demonstrations, from whose starts the controls are applied.
        controls: (N, B, T, m) B samples for each.
        dt: time for which a control is held [s].
        substep: the longest step of the integrator [s].
    """
    substeps = int(np.ceil(dt / substep - 1e-9))
    starts = np.array([demonstration.task.start for demonstration in demonstrations])
    # All at once: a step of the integrator costs the same for many.
    final = rollout(system, starts[:, None], controls, dt, substeps)[..., -1, :]
    return np.array(
        [
            np.mean(final_state_error(system.space, ends, demonstration.task.goal))
            for ends, demonstration in zip(final, demonstrations, strict=True)
        ]
    )
