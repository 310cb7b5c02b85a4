"""What is known of a discretisation and its tasks before anybody demonstrates, as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration
from mlci.diagnosis import Diagnosis, diagnose
from mlci.maxent import TrajectoryDistribution
from mlci.outlook.flow import control_reach, flow_expansion
from mlci.spaces import Bools, Box, Floats
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
    "rivals",
    "expected_violations",
)


@dataclass(frozen=True, eq=False)
class Outlook:
    """A discretisation with the tasks that are to be demonstrated in it.

    Attributes:
        diagnosis: how the model moves.
        reach: (n,) cells that the range of actions spans after a step, see `control_reach`.
        expansion: mean over tasks of the logarithm by which the flow stretches, see
            `flow_expansion`.
        reachable: (P,) whether the tabular agent reaches a task's goal.
        touched: (C,) share of the tasks whose optimum without a constraint enters a region.
        crossed: (C,) mean over tasks of Phi, 0 where the goal is out of reach.
        forecast_error: violation distance (11) of these optima, the mean over tasks that the
            tabular agent can do, as a share of the regions that an optimum enters.
    """

    diagnosis: Diagnosis
    reach: Floats
    expansion: float
    reachable: Bools
    touched: Floats
    crossed: Floats
    forecast_error: float

    def features(self, demonstrations: int) -> Floats:
        """(C, F) the numbers of FEATURES, were region i the truth.

        What has a scale is taken by its logarithm, that of a little more where it may be 0. Rivals
        of a region are expected to be ranked before it: they are crossed at least as often by the
        tabular agent, and yet no demonstration enters them, as if tasks were independent and
        optima those of an agent without a constraint.

        Args:
            demonstrations: how many are to be seen.
        """
        whole = [
            max(self.diagnosis.frozen),
            np.log(self.diagnosis.cells_crossed),
            np.log(np.min(self.reach) + 0.01),
            self.expansion,
            float(np.mean(~self.reachable)),
            self.forecast_error,
        ]
        left = (1 - self.touched) ** demonstrations  # probability that none enters a region
        rivals = np.log1p((self.crossed >= self.crossed[:, None]) @ left - left)
        expected = np.log(0.1 + demonstrations * self.crossed)
        shared = np.tile(whole, (len(self.touched), 1))
        return np.column_stack([shared, self.touched, rivals, expected])


def outlook(
    model: TabularModel, paths: Sequence[Demonstration], hypotheses: ArrayLike | None = None
) -> Outlook:
    """What is known before anybody demonstrates.

    Args:
        model: the tabular model.
        paths: of each task the optimum without a constraint, with controls and times.
        hypotheses: (C',) mask over its regions; None takes all.

    Raises:
        ValueError: no path.
    """
    if not paths:
        raise ValueError("an outlook needs the optimal path of a task at least")
    mask = np.ones(len(model.regions), dtype=bool) if hypotheses is None else np.asarray(hypotheses)
    crossed = np.zeros((len(paths), int(np.sum(mask))))
    reachable = np.zeros(len(paths), dtype=bool)
    for number, path in enumerate(paths):
        distribution = TrajectoryDistribution.of_task(model, path.task)
        reachable[number] = distribution.is_possible
        if distribution.is_possible:
            crossed[number] = distribution.violation_probabilities()[mask]
    touched = np.array([model.regions.violated_by(path.states)[mask] for path in paths])
    errors = np.sum(np.abs(crossed - touched), axis=1)[reachable]
    entered = max(float(np.mean(np.sum(touched, axis=1))), 1.0)
    actions = Box(model.actions.min(axis=0), model.actions.max(axis=0))
    return Outlook(
        diagnosis=diagnose(model),
        reach=control_reach(model.system, model.grid, actions, model.dt),
        expansion=float(np.mean([flow_expansion(model.system, path) for path in paths])),
        reachable=reachable,
        touched=np.mean(touched, axis=0),
        crossed=np.mean(crossed, axis=0),
        forecast_error=float(np.mean(errors)) / entered if reachable.any() else 1.0,
    )
