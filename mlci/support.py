"""Which demonstrations the first region owes its place to, and whether it is first without each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.evidence import TIE, total_gain
from mlci.inference import Inference
from mlci.spaces import Bools, Floats, Ints

_DECIMALS = 9  # of a share: what differs beyond is rounding


@dataclass(frozen=True, eq=False)
class Support:
    """What the gain of the region that comes first rests on.

    Attributes:
        region: its number.
        share: (N,) share of its gain that each demonstration brings, among those that bring some;
            all 0 where none does. Infinite evidence outweighs any other, and several share alike.
        first_without: (N,) the region that comes first when a demonstration is left out: `region`
            if none has more gain, else that with the most, ties by number.
    """

    region: int
    share: Floats
    first_without: Ints

    @property
    def stays(self) -> Bools:
        """(N,) whether the region stays first when a demonstration is left out."""
        return self.first_without == self.region

    def carriers(self, part: float = 0.5) -> Ints:
        """The fewest demonstrations that bring this part of the gain, the largest share first."""
        order = np.argsort(-np.round(self.share, _DECIMALS), kind="stable")
        held = np.cumsum(self.share[order])
        if not len(held) or held[-1] == 0:
            return order[:0]
        return order[: int(np.searchsorted(held, part - 1e-12)) + 1]


def support(inference: Inference) -> Support:
    """The support of an inference's first region.

    Raises:
        ValueError: there is no hypothesis.
    """
    if not len(inference.hypotheses):
        raise ValueError("without hypotheses no region comes first")
    first, evidence = int(inference.order[0]), inference.evidence
    brings = np.maximum(evidence[:, first], 0.0)
    if np.any(brings == np.inf):
        brings = (brings == np.inf).astype(float)
    total = np.sum(brings)
    return Support(
        region=first,
        share=brings / total if total > 0 else np.zeros(len(brings)),
        first_without=np.array(
            [_first(total_gain(np.delete(evidence, j, axis=0)), first) for j in range(len(brings))],
            dtype=np.int64,
        ),
    )


def _first(gain: Floats, preferred: int) -> int:
    """The region with the most gain, or the preferred one if it ties."""
    ties = gain >= np.max(gain) - TIE
    return preferred if ties[preferred] else int(np.argmax(ties))
