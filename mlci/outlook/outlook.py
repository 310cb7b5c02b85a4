"""What is known of a discretisation and its tasks before anybody demonstrates, as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration
from mlci.diagnosis import Diagnosis, diagnose
from mlci.evidence import DEFAULT_MODEL_ERROR, rank_scores
from mlci.maxent import TrajectoryDistribution
from mlci.outlook.detours import Detours, tabular_detours
from mlci.outlook.flow import control_reach, flow_expansion
from mlci.preparation import prepare
from mlci.regions import as_mask
from mlci.spaces import Bools, Box, Floats, Ints
from mlci.tabular import TabularModel

# What success may be predicted by; `Outlook.features` has a number for each.
FEATURES = (
    "frozen",
    "cells_crossed",
    "reach",
    "expansion",
    "unreachable",
    "forecast_error",
    "touched",
    "expected_violations",
    "simulated",
)
_STUDIES = 200  # that are simulated of a truth
_TWO_OF_100 = 0.02  # added to shares whose log odds are taken


@dataclass(frozen=True, eq=False)
class Outlook:
    """A discretisation with the tasks that are to be demonstrated in it.

    Attributes:
        diagnosis: how the model moves.
        reach: (n,) cells that the range of actions spans after a step, see `control_reach`.
        expansion: mean over tasks of the logarithm by which the flow stretches, see
            `flow_expansion`.
        reachable: (P,) whether the tabular agent reaches a task's goal, between cells.
        entered: (P, C) whether the optimum of a task without a constraint enters a region.
        ends: (P, C) whether it begins or ends there, so that nobody can do the task if the region
            is forbidden.
        phi: (P, C) Phi as `mlci.infer` takes it, between states; 0 where it says nothing, as where
            the goal is out of reach.
        detours: what else is crossed on the way round a region.
    """

    diagnosis: Diagnosis
    reach: Floats
    expansion: float
    reachable: Bools
    entered: Bools
    ends: Bools
    phi: Floats
    detours: Detours

    @property
    def touched(self) -> Floats:
        """(C,) share of the tasks whose optimum enters a region."""
        return np.asarray(np.mean(self.entered, axis=0))

    @property
    def crossed(self) -> Floats:
        """(C,) mean over tasks of Phi."""
        return np.asarray(np.mean(self.phi, axis=0))

    @property
    def forecast_error(self) -> float:
        """Violation distance (11) of the optima, the mean over tasks that the tabular agent can do,
        as a share of the regions that an optimum enters; 1 if it can do none."""
        if not self.reachable.any():
            return 1.0
        off = np.sum(np.abs(self.phi - self.entered), axis=1)[self.reachable]
        return float(np.mean(off) / max(np.mean(np.sum(self.entered, axis=1)), 1.0))

    def simulated_success(self, truth: int, demonstrations: int, top: int) -> float:
        """Share of simulated studies that rank a region among the first, were it the truth.

        A study has so many tasks, drawn from those that neither begin nor end in the truth, and
        ranks by evidence as `mlci.infer` does. Who does a task whose optimum keeps out of the truth
        is taken to do it optimally, and who must go round it to do so as `detours` say.

        Args:
            truth: number of the region.
            demonstrations: of a study.
            top: it succeeds if the truth is among so many.
        """
        can_be_done = ~self.ends[:, truth]
        if not can_be_done.any():
            return 0.0
        evidence = -np.log1p((DEFAULT_MODEL_ERROR - 1) * self.phi)
        round_it = np.flatnonzero(self.entered[:, truth] & can_be_done)
        crossed = self.entered.copy()
        crossed[round_it] = self.detours(truth, round_it)
        shares = can_be_done / np.sum(can_be_done)
        times = np.random.default_rng(0).multinomial(demonstrations, shares, size=_STUDIES)
        feasible = times @ crossed.astype(float) == 0
        return float(np.mean(rank_scores(times @ evidence, feasible)[:, truth] <= top))

    def features(self, regions: ArrayLike, demonstrations: int, top: int) -> Floats:
        """(B, F) the numbers of FEATURES, were each of some regions the truth.

        What has a scale is taken by its logarithm, that of a little more where it may be 0, and the
        share of simulated studies by its log odds.

        Args:
            regions: (B,) their numbers.
            demonstrations: how many are to be seen.
            top: success is that the truth is among so many.
        """
        numbers: Ints = np.asarray(regions, dtype=np.int64)
        whole = [
            max(self.diagnosis.frozen),
            np.log(self.diagnosis.cells_crossed),
            np.log(np.min(self.reach) + 0.01),
            self.expansion,
            float(np.mean(~self.reachable)),
            self.forecast_error,
        ]
        shared = np.tile(whole, (len(numbers), 1))
        expected = np.log(0.1 + demonstrations * self.crossed[numbers])
        simulated = [
            self.simulated_success(number, demonstrations, top) for number in numbers.tolist()
        ]
        success = np.array(simulated) + _TWO_OF_100
        odds = np.log(success / (1 + 2 * _TWO_OF_100 - success))
        return np.column_stack([shared, self.touched[numbers], expected, odds])


def outlook(
    model: TabularModel, paths: Sequence[Demonstration], hypotheses: ArrayLike | None = None
) -> Outlook:
    """What is known before anybody demonstrates.

    Args:
        model: the tabular model.
        paths: of each task the optimum without a constraint, with controls and times.
        hypotheses: (C',) mask over its regions; None takes all.

    Raises:
        ValueError: no path, or a mask of another length.
    """
    if not paths:
        raise ValueError("an outlook needs the optimal path of a task at least")
    mask = as_mask(hypotheses, len(model.regions))
    tasks = [path.task for path in paths]
    prepared = prepare(model, tasks, hypotheses=mask)
    entered, begins, stops = (
        np.array([model.regions.violated_by(states)[mask] for states in each])
        for each in (
            [path.states for path in paths],
            [path.states[:1] for path in paths],
            [path.states[-1:] for path in paths],
        )
    )
    actions = Box(model.actions.min(axis=0), model.actions.max(axis=0))
    return Outlook(
        diagnosis=diagnose(model),
        reach=control_reach(model.system, model.equal_cells, actions, model.dt),
        expansion=float(np.mean([flow_expansion(model.system, path) for path in paths])),
        reachable=np.array(
            [TrajectoryDistribution.of_task(model, task).is_possible for task in tasks]
        ),
        entered=entered,
        ends=begins | stops,
        phi=np.where(prepared.decided_by_cell, 0.0, 1 - prepared.avoidance),
        detours=tabular_detours(model, tasks, mask),
    )
