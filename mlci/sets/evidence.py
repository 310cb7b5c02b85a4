"""Evidence for sets of constraints, of any size.

A demonstration violates a set if it enters any of its regions, and avoids it if it keeps out of
all. Its evidence is that of a region (`mlci.evidence`), with the probability of avoiding all of the
set in place of alpha. What several regions explain is not the sum of what each does: of neighbours
that somebody avoids on one detour, both together explain hardly more than one.

One recursion a task gives the evidence of a set together with each further region. Whoever searches
sets asks for nothing else, and what was asked is remembered.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration
from mlci.evidence import PAPER, Rates, log_evidence, total_gain
from mlci.inference import Inference
from mlci.models import Distribution, Model, distribution_of
from mlci.regions import as_mask
from mlci.spaces import Bools, Floats

# From a mask (C,) of regions, log alpha (C,) of avoiding all of them and each.
Beside = Callable[[Bools], Floats]


class SetGains(Protocol):
    """The gain of sets of C hypotheses [nat]."""

    @property
    def regions(self) -> int:
        """C."""

    @property
    def feasible(self) -> Bools:
        """(C,) regions that may be in a set whose gain is not -inf."""

    def beside(self, members: Bools) -> Floats:
        """(C,) gain of a set, a mask (C,), together with each region; of a member, its own."""

    def gain(self, members: Bools) -> float:
        """The gain of a set."""


@dataclass(frozen=True, eq=False)
class SetEvidence:
    """What N demonstrations say of sets of C regions.

    Attributes:
        avoidance: (N,) for each task log alpha of sets, such as
            `TrajectoryDistribution.log_avoidance_beside`; None where it cannot be done, so that a
            demonstration says nothing by what it avoids.
        violated: (N, C) which regions each demonstration violates.
        rates: model error and rule breaking.
        silent: (N, C) regions that say nothing of a demonstration that avoids them; none by
            default.

    Raises:
        ValueError: shapes that disagree.
    """

    avoidance: Sequence[Beside | None]
    violated: Bools
    rates: Rates = PAPER
    silent: Bools = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))

    def __post_init__(self) -> None:
        if not self.silent.size:
            object.__setattr__(self, "silent", np.zeros(self.violated.shape, dtype=bool))
        shape = self.violated.shape
        if len(shape) != 2 or self.silent.shape != shape or len(self.avoidance) != shape[0]:
            raise ValueError(
                f"{len(self.avoidance)} tasks do not fit violated {shape} and silent "
                f"{self.silent.shape}, which need (N, C)"
            )

    @classmethod
    def of(
        cls,
        model: Model,
        demonstrations: Sequence[Demonstration],
        inference: Inference,
        *,
        hypotheses: Bools | None = None,
        exact_ends: bool = True,
    ) -> SetEvidence:
        """That of sets of the regions that an inference is about, with its rates.

        Args:
            model: the model.
            demonstrations: the N that the inference is from.
            inference: what `infer` says of them, without a calibration.
            hypotheses: (C',) mask over the model's regions, as of `infer`.
            exact_ends: as of `infer`.

        Raises:
            ValueError: an inference about other regions or demonstrations, or a calibrated one,
                whose map says nothing of sets.
        """
        mask = as_mask(hypotheses, len(model.regions))
        shape = len(demonstrations), int(np.sum(mask))
        if inference.avoidance.shape != shape:
            raise ValueError(
                f"{shape[0]} demonstrations and {shape[1]} regions do not fit an inference from "
                f"{inference.avoidance.shape}"
            )
        if inference.calibration is not None:
            raise ValueError("a calibration says nothing of sets: infer without one")
        distributions = [
            distribution_of(model, each.task, round_horizon=True, exact_ends=exact_ends)
            for each in demonstrations
        ]
        return cls(
            [_beside(each, mask) if each.is_possible else None for each in distributions],
            inference.violated,
            inference.rates,
            inference.decided_by_cell,
        )

    @property
    def regions(self) -> int:
        """C."""
        return self.violated.shape[1]

    @property
    def feasible(self) -> Bools:
        """(C,) regions that may be in a set whose gain is not -inf."""
        if self.rates.rule_breaking > 0:
            return np.ones(self.regions, dtype=bool)
        return ~np.any(self.violated, axis=0)

    def beside(self, members: Bools) -> Floats:
        """(C,) gain [nat] of a set, a mask (C,), together with each region; of a member, its own.

        -inf where a violation excludes it; +inf where some tabular agent cannot avoid it although
        its demonstration does, if the model has no error.
        """
        crossed = self.violated | np.any(self.violated[:, members], axis=1)[:, None]
        alpha = np.ones(self.violated.shape)
        for j, beside in enumerate(self.avoidance):
            if beside is not None and not np.all(crossed[j]):
                alpha[j] = self._alpha(j, beside, members)
        return total_gain(log_evidence(alpha, crossed, self.rates))

    def gain(self, members: Bools) -> float:
        """The gain of a set, a mask (C,) [nat]; 0 of none."""
        if not np.any(members):
            return 0.0
        last = int(np.flatnonzero(members)[-1])
        rest = members.copy()
        rest[last] = False
        return float(self.beside(rest)[last])

    def of_some(self, demonstrations: ArrayLike) -> SetEvidence:
        """That of some demonstrations, by number; what was asked of their tasks stays known."""
        some = np.asarray(demonstrations, dtype=np.int64)
        return SetEvidence(
            [self.avoidance[j] for j in some], self.violated[some], self.rates, self.silent[some]
        )

    def _alpha(self, number: int, beside: Beside, members: Bools) -> Floats:
        """alpha (C,) of a task: what is silent adds nothing to the others."""
        silent = self.silent[number]
        others = members & ~silent
        alpha = np.minimum(np.exp(beside(others)), 1.0)
        alpha[silent] = alpha[others][0] if others.any() else 1.0
        return alpha


def _beside(distribution: Distribution, hypotheses: Bools) -> Beside:
    """log alpha of sets of the hypotheses, a mask (C',) over the model's regions; remembered."""

    known: dict[bytes, Floats] = {}

    def beside(others: Bools) -> Floats:
        key = np.packbits(others).tobytes()
        if key not in known:
            mask = hypotheses.copy()
            mask[hypotheses] = others
            known[key] = distribution.log_avoidance_beside(mask)[hypotheses]
        return known[key]

    return beside
