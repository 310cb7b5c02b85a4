"""A region, a limit of the controls, or both at once? Belief over pairs of these.

Hypotheses are pairs (i, j) of a region or none and of a set of controls or none, so that nothing,
one region, one set of controls, and each of both together compete in one posterior. Under (i, j)
moves into region i and moves that apply controls j are both left out, of one distribution a task:

    alpha_ij = P(no move of a trajectory enters i or applies j),

which is not alpha_i alpha_j, as who may not push goes other ways. Evidence is that of a region
(`mlci.evidence`), and a demonstration violates a pair if it violates one of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy  # loads scipy.special when it is first used
from numpy.typing import ArrayLike

from mlci.actuation.inference import ControlInference
from mlci.actuation.moves import ControlledMoves
from mlci.demonstrations import Demonstration
from mlci.evidence import DEFAULT_MODEL_ERROR, Rates, log_evidence, total_gain
from mlci.inference import Inference
from mlci.regions import as_mask
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import TabularModel

if TYPE_CHECKING:
    import pandas as pd

KINDS = ("nothing", "a region", "controls", "both")
NOTHING = "-"  # the name of no region, or of no controls


@dataclass(frozen=True, eq=False)
class JointInference:
    """What N demonstrations say of pairs of C regions and J hypotheses about controls.

    The last of each axis of C + 1 and J + 1 is none.

    Attributes:
        regions: (C + 1,) names of the regions, and of none.
        controls: (J + 1,) names of the hypotheses about controls, and of none.
        avoidance: (N, C + 1, J + 1) alpha, as it counts for evidence.
        violated: (N, C + 1, J + 1) which pairs a demonstration violates.
        kinds: (4,) prior probability of each of `KINDS`; pairs of a kind are equally probable.
        rates: model error and rule breaking.

    Raises:
        ValueError: shapes that disagree, or a prior that does not add up to 1.
    """

    regions: tuple[str, ...]
    controls: tuple[str, ...]
    avoidance: Floats
    violated: Bools
    kinds: tuple[float, float, float, float]
    rates: Rates

    def __post_init__(self) -> None:
        shape = len(self.regions), len(self.controls)
        if not self.avoidance.shape[1:] == self.violated.shape[1:] == shape:
            raise ValueError(
                f"avoidance {self.avoidance.shape} and violated {self.violated.shape} do not fit "
                f"{shape[0]} regions and {shape[1]} controls, the last of each being none"
            )
        if len(self.kinds) != 4 or min(self.kinds) < 0 or not np.isclose(sum(self.kinds), 1):
            raise ValueError(f"probabilities of {KINDS} add up to 1, not {self.kinds}")

    @cached_property
    def evidence(self) -> Floats:
        """(N, C + 1, J + 1) log evidence of each demonstration [nat]; 0 for nothing."""
        flat = len(self.avoidance), -1
        terms = log_evidence(
            self.avoidance.reshape(flat), self.violated.reshape(flat), self.rates
        ).reshape(self.avoidance.shape)
        terms[:, -1, -1] = 0.0
        return terms

    @cached_property
    def gain(self) -> Floats:
        """(C + 1, J + 1) how much likelier the demonstrations are than under nothing [nat]."""
        shape = self.evidence.shape
        return total_gain(self.evidence.reshape(shape[0], -1)).reshape(shape[1:])

    @cached_property
    def posterior(self) -> Floats:
        """(C + 1, J + 1) probability of each pair; the last of all is of nothing."""
        kind = self._kind
        with np.errstate(divide="ignore"):
            prior = np.log(np.array(self.kinds) / np.maximum(np.bincount(kind.ravel()), 1))
        weight = prior[kind] + self.gain
        return np.asarray(scipy.special.softmax(weight))

    @property
    def of_kinds(self) -> Floats:
        """(4,) posterior probability of each of `KINDS`."""
        return np.array([np.sum(self.posterior[self._kind == k]) for k in range(len(KINDS))])

    @property
    def of_regions(self) -> Floats:
        """(C,) posterior probability of each region, with or without controls."""
        return np.asarray(self.posterior[:-1].sum(axis=1))

    @property
    def of_controls(self) -> Floats:
        """(J,) the same of controls, with or without a region."""
        return np.asarray(self.posterior[:, :-1].sum(axis=0))

    @property
    def most_probable(self) -> tuple[str, str]:
        """Names of the most probable region and controls, each `NOTHING` for none."""
        i, j = np.unravel_index(np.argmax(self.posterior), self.posterior.shape)
        return self.regions[i], self.controls[j]

    def of_some(self, demonstrations: ArrayLike) -> JointInference:
        """That of some demonstrations, by number."""
        some = np.asarray(demonstrations, dtype=np.int64)
        return JointInference(
            self.regions,
            self.controls,
            self.avoidance[some],
            self.violated[some],
            self.kinds,
            self.rates,
        )

    def to_frame(self) -> pd.DataFrame:
        """A row a pair, the most probable first: `region`, `controls`, `gain`, `posterior`."""
        import pandas as pd

        order = np.argsort(-self.posterior, axis=None, kind="stable")
        i, j = np.unravel_index(order, self.posterior.shape)
        names = (np.array(each, dtype=object) for each in (self.regions, self.controls))
        regions, controls = names
        columns = {"region": regions[i], "controls": controls[j]}
        return pd.DataFrame({**columns, "gain": self.gain[i, j], "posterior": self.posterior[i, j]})

    @property
    def _kind(self) -> Ints:
        """(C + 1, J + 1) which of `KINDS` a pair is."""
        of_region, of_control = (
            np.arange(len(each)) < len(each) - 1 for each in (self.regions, self.controls)
        )
        return of_region[:, None] + 2 * of_control[None, :].astype(np.int64)


def infer_joint(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    controls: ControlInference,
    *,
    kinds: tuple[float, float, float, float] = (0.5, 0.2, 0.2, 0.1),
    rates: Rates | None = None,
    hypotheses: ArrayLike | None = None,
    exact_ends: bool = True,
    round_horizon: bool = False,
) -> JointInference:
    """Weigh pairs of a region and of controls by demonstrations, in one posterior.

    Args:
        model: the tabular model.
        demonstrations: the N that both inferences are from.
        inference: what they say of the C regions, for what they violate and what cells decide.
        controls: what they say of the J hypotheses about controls.
        kinds: prior probability of each of `KINDS`.
        rates: model error and rule breaking; those of `inference` by default. A calibration of
            either inference says nothing of pairs and does not count: `DEFAULT_MODEL_ERROR` of
            `mlci.evidence` takes its place.
        hypotheses: (C',) mask over the model's regions, as of `mlci.infer`.
        exact_ends: as of `mlci.infer`.
        round_horizon: likewise.

    Raises:
        TypeError, ValueError: as of `infer_controls`; or inferences from other demonstrations.
    """
    mask, count = as_mask(hypotheses, len(model.regions)), len(demonstrations)
    shapes = inference.violated.shape, controls.applied.shape
    if shapes != ((count, int(np.sum(mask))), (count, len(controls.hypotheses))):
        raise ValueError(
            f"inferences of shapes {shapes[0]} and {shapes[1]} do not fit {count} demonstrations "
            f"and {int(np.sum(mask))} regions"
        )
    moves = ControlledMoves.of(model, controls.hypotheses, with_regions=True)
    alpha = moves.joint_avoidance(
        [each.task for each in demonstrations], exact_ends=exact_ends, round_horizon=round_horizon
    )[:, np.append(mask, True)]
    if rates is None:
        rates = inference.rates
        if inference.calibration is not None:
            rates = replace(rates, model_error=DEFAULT_MODEL_ERROR)
    silent = np.pad(inference.decided_by_cell, ((0, 0), (0, 1)))
    alpha = np.where(silent[:, :, None], alpha[:, -1:], alpha)
    entered = np.pad(inference.violated, ((0, 0), (0, 1)))
    applied = np.pad(controls.applied, ((0, 0), (0, 1)))
    return JointInference(
        (*inference.hypotheses.names, NOTHING),
        (*controls.hypotheses.names, NOTHING),
        alpha,
        entered[:, :, None] | applied[:, None, :],
        kinds,
        rates,
    )
