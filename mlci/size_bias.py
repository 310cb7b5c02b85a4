"""Do larger regions come first because they are larger?"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mlci.evidence import rank_scores
from mlci.inference import Inference
from mlci.json_numbers import finite
from mlci.region_sizes import region_sizes
from mlci.spaces import Floats

_MUCH_LARGER = 3.0  # times the median of the others
_SAME_SIZE = 1e-6  # regions whose sizes differ by less, as a share, are of one size
_FEW = 3  # hypotheses that have a correlation at least


@dataclass(frozen=True, eq=False)
class SizeBias:
    """How gains go with sizes, among hypotheses that no demonstration violates.

    Attributes:
        sizes: (C,) share of the state space that each hypothesis holds.
        first: name of the hypothesis that comes first.
        ratio: its size by the median of the others.
        correlation: Spearman's, of gain and size; NaN for fewer than three.
        by_size: name of the hypothesis that comes first with prior weights of 1 / size.
        size_prior: the power that was taken instead of 1.
    """

    sizes: Floats
    first: str
    ratio: float
    correlation: float
    by_size: str
    size_prior: float

    @property
    def warnings(self) -> list[str]:
        """That the first hypothesis may be so by its size alone."""
        if self.ratio < _MUCH_LARGER or self.size_prior > 0:
            return []
        instead = "it still" if self.by_size == self.first else self.by_size
        return [
            f"region {self.first}, which comes first, is {self.ratio:.3g} times as large as the "
            "median of the others, and larger regions explain more (rank correlation of gain and "
            f"size {self.correlation:.2f}): with inference.size_prior=1, which weighs against "
            f"that, {instead} comes first"
        ]

    def record(self) -> dict[str, Any]:
        """The numbers, for a program."""
        return {
            "first": self.first,
            "ratio": finite(self.ratio),
            "correlation": finite(self.correlation),
            "first_by_size": self.by_size,
            "size_prior": self.size_prior,
        }


def size_bias(inference: Inference) -> SizeBias | None:
    """How gains go with the sizes of hypotheses; None where all are of one size, or none is left.

    Args:
        inference: whose hypotheses are compared.
    """
    sizes, names = region_sizes(inference.hypotheses), inference.hypotheses.names
    feasible = np.flatnonzero(inference.gain > -np.inf)
    if not len(feasible) or np.ptp(sizes) <= _SAME_SIZE * np.max(sizes):
        return None
    first = int(inference.order[0])
    others = sizes[feasible[feasible != first]]
    weighed = replace(inference, size_prior=1.0)
    return SizeBias(
        sizes,
        names[first],
        float(sizes[first] / np.median(others)) if len(others) and np.median(others) else np.nan,
        _rank_correlation(inference.gain[feasible], sizes[feasible]),
        names[int(weighed.order[0])],
        inference.size_prior,
    )


def _rank_correlation(gain: Floats, size: Floats) -> float:
    """Spearman's; NaN for few pairs, or where one of the two does not vary."""
    ranks = [rank_scores(values, values > -np.inf) for values in (gain, size)]
    if len(gain) < _FEW or any(np.ptp(rank) == 0 for rank in ranks):
        return np.nan
    one, other = (rank - np.mean(rank) for rank in ranks)
    return float(one @ other / np.sqrt((one @ one) * (other @ other)))
