"""Belief over sets of constraints: none, each one alone, and each pair at once, exactly.

A set is violated by a demonstration that enters any of its regions, and avoided by one that keeps
out of all. Its evidence is that of a region (`mlci.evidence`), with the probability of avoiding all
of the set in place of alpha. Regions that somebody avoids on one detour are no two independent
proofs: of neighbours, both together explain hardly more than one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration
from mlci.evidence import PAPER, Rates, log_evidence, posterior, total_gain
from mlci.inference import Inference
from mlci.maxent import TrajectoryDistribution
from mlci.spaces import Bools, Floats
from mlci.tabular import TabularModel

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class SetPosterior:
    """Probabilities of the sets of up to two of C regions.

    Attributes:
        none: that there is no constraint.
        probability: (C, C) that of the pair i, j is the constraint, for i < j; of i alone, on the
            diagonal; 0 below it.
        gain: (C, C) log likelihood gain of the same sets [nat]; -inf below.
    """

    none: float
    probability: Floats
    gain: Floats

    @property
    def marginal(self) -> Floats:
        """(C,) probability that a region is forbidden, alone or with another."""
        alone = np.diag(self.probability)
        return self.probability.sum(axis=0) + self.probability.sum(axis=1) - alone

    def most_probable(self) -> tuple[int, ...]:
        """The numbers of the most probable set: none, one or two of them."""
        i, j = np.unravel_index(np.argmax(self.probability), self.probability.shape)
        if self.none >= self.probability[i, j]:
            return ()
        return (int(i),) if i == j else (int(i), int(j))

    def to_frame(self, names: Sequence[str]) -> pd.DataFrame:
        """A row a set, the most probable first: `first` and `second`, names of its regions, missing
        where it has fewer; `gain` [nat]; `probability`."""
        import pandas as pd

        i, j = np.triu_indices(len(self.probability))
        labels = np.array([*names, None], dtype=object)
        second = np.where(i == j, len(names), j)
        frame = pd.DataFrame(
            {
                "first": [None, *labels[i]],
                "second": [None, *labels[second]],
                "gain": [0.0, *self.gain[i, j]],
                "probability": [self.none, *self.probability[i, j]],
            }
        )
        return frame.sort_values("probability", ascending=False, kind="stable", ignore_index=True)


def set_posterior(
    joint_avoidance: ArrayLike,
    violated: ArrayLike,
    prior: Sequence[float] = (0.5, 0.4, 0.1),
    rates: Rates = PAPER,
) -> SetPosterior:
    """Exact posterior over no constraint, each region and each pair of regions.

    Args:
        joint_avoidance: (N, C, C) probability that each task's unconstrained agent enters neither
            region i nor j, on the diagonal not i; as of
            `TrajectoryDistribution.joint_avoidance_probabilities`.
        violated: (N, C) which regions each demonstration violates.
        prior: of none, of some one region and of some pair, each of which are equally probable.
        rates: model error and rule breaking.

    Raises:
        ValueError: shapes that disagree, or a prior that does not add up to 1.
    """
    joint, crossed = np.asarray(joint_avoidance, dtype=float), np.asarray(violated, dtype=bool)
    if joint.ndim != 3 or joint.shape != (*crossed.shape, crossed.shape[-1]):
        raise ValueError(
            f"joint_avoidance {joint.shape} and violated {crossed.shape} are not (N, C, C), (N, C)"
        )
    if len(prior) != 3 or min(prior) < 0 or not np.isclose(sum(prior), 1):
        raise ValueError(f"a prior of none, one and two adds up to 1, not {tuple(prior)}")
    count = crossed.shape[1]
    i, j = np.triu_indices(count)
    evidence = log_evidence(joint[:, i, j], crossed[:, i] | crossed[:, j], rates)
    gain = total_gain(evidence)
    alone = i == j
    share = np.where(alone, prior[1] / count, prior[2] / max(1, count * (count - 1) // 2))
    each, none = posterior(gain, 1 - float(np.sum(share)), share)
    probability, gains = np.zeros((count, count)), np.full((count, count), -np.inf)
    probability[i, j], gains[i, j] = each, gain
    return SetPosterior(float(none), probability, gains)


def infer_sets(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    prior: Sequence[float] = (0.5, 0.4, 0.1),
    *,
    exact_ends: bool = True,
) -> SetPosterior:
    """Belief over none, one and two of a model's regions, from an inference about each alone.

    Args:
        model: the tabular model.
        demonstrations: N demonstrations.
        inference: what `infer` says of them about all regions of the model, with its rates.
        prior: of none, of some one region and of some pair.
        exact_ends: as of `infer`.

    Raises:
        ValueError: an inference about other regions or demonstrations, or a calibrated one, whose
            map says nothing of pairs.
    """
    shape = len(demonstrations), len(model.regions)
    if inference.avoidance.shape != shape:
        raise ValueError(
            f"{shape[0]} demonstrations and {shape[1]} regions do not fit an inference from "
            f"{inference.avoidance.shape}"
        )
    if inference.calibration is not None:
        raise ValueError("a calibration says nothing of pairs: infer without one")
    joint = np.ones((*shape, shape[1]))
    for number, demonstration in enumerate(demonstrations):
        distribution = TrajectoryDistribution.of_task(
            model, demonstration.task, round_horizon=True, exact_ends=exact_ends
        )
        if distribution.is_possible:
            joint[number] = distribution.joint_avoidance_probabilities()
    joint = _without_silent(joint, inference.decided_by_cell)
    return set_posterior(joint, inference.violated, prior, inference.rates)


def _without_silent(joint: Floats, silent: Bools) -> Floats:
    """alpha (N, C, C) in which regions (N, C) that say nothing are avoided for certain."""
    single = np.where(silent, 1.0, np.diagonal(joint, axis1=1, axis2=2))
    first, second = silent[:, :, None], silent[:, None, :]
    some = np.where(first, single[:, None, :], np.where(second, single[:, :, None], joint))
    return np.where(np.eye(joint.shape[1], dtype=bool), single[:, None, :], some)
