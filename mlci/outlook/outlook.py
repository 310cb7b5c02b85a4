"""What is known of a discretisation and its tasks before anybody demonstrates, as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration
from mlci.diagnosis import Diagnosis, diagnose
from mlci.evidence import DEFAULT_MODEL_ERROR
from mlci.maxent import TrajectoryDistribution
from mlci.outlook.flow import control_reach, flow_expansion
from mlci.regions import as_mask
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
        entered: (P, C) whether the optimum of a task without a constraint enters a region.
        phi: (P, C) Phi, 0 where the goal is out of reach.
    """

    diagnosis: Diagnosis
    reach: Floats
    expansion: float
    reachable: Bools
    entered: Bools
    phi: Floats

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

    def rivals(self, demonstrations: int) -> Floats:
        """(C,) regions that are expected to be ranked before region i, were it the truth.

        A region is, if its evidence is at least as large in these tasks, and no demonstration
        enters it. Who does a task whose optimum keeps out of the truth is taken to do it optimally,
        and who must go round the truth to keep out of the other too. So a region survives so many
        demonstrations with probability (1 - q)^demonstrations, where q is the share of the tasks
        whose optimum enters it and not the truth.
        """
        evidence = np.mean(-np.log1p((DEFAULT_MODEL_ERROR - 1) * self.phi), axis=0)
        without = (~self.entered).T.astype(float) @ self.entered / len(self.entered)  # (truth, r)
        before = evidence >= evidence[:, None]
        np.fill_diagonal(before, val=False)
        return np.asarray(np.sum(before * (1 - without) ** demonstrations, axis=1))

    def features(self, demonstrations: int) -> Floats:
        """(C, F) the numbers of FEATURES, were region i the truth.

        What has a scale is taken by its logarithm, that of a little more where it may be 0.

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
        rivals = np.log1p(self.rivals(demonstrations))
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
        ValueError: no path, or a mask of another length.
    """
    if not paths:
        raise ValueError("an outlook needs the optimal path of a task at least")
    mask = as_mask(hypotheses, len(model.regions))
    phi = np.zeros((len(paths), int(np.sum(mask))))
    reachable = np.zeros(len(paths), dtype=bool)
    for number, path in enumerate(paths):
        distribution = TrajectoryDistribution.of_task(model, path.task)
        reachable[number] = distribution.is_possible
        if distribution.is_possible:
            phi[number] = distribution.violation_probabilities()[mask]
    entered = np.array([model.regions.violated_by(path.states)[mask] for path in paths])
    actions = Box(model.actions.min(axis=0), model.actions.max(axis=0))
    return Outlook(
        diagnosis=diagnose(model),
        reach=control_reach(model.system, model.equal_cells, actions, model.dt),
        expansion=float(np.mean([flow_expansion(model.system, path) for path in paths])),
        reachable=reachable,
        entered=entered,
        phi=phi,
    )
