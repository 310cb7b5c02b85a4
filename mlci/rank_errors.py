"""How surely a ranking is known whose probabilities are sampled, and samples until it is.

Each replicate of the probabilities gives a ranking. The interval of a hypothesis's rank holds the
middle 95 % of its ranks, and a rank is settled where that is one number.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mlci.demonstrations import Demonstration
from mlci.inference import Inference
from mlci.preparation import infer
from mlci.sampled.distribution import SampledModel
from mlci.spaces import Bools, Floats

LEVEL = 0.95


@dataclass(frozen=True, eq=False)
class RankErrors:
    """Where the ranks of C hypotheses lie.

    Attributes:
        rank: (C,) as the probabilities are.
        lowest: (C,) lower end of each rank's interval.
        highest: (C,) upper end.
        gain_error: (C,) standard error of the gain [nat]; nan where the gain is infinite.
    """

    rank: Floats
    lowest: Floats
    highest: Floats
    gain_error: Floats

    @property
    def settled(self) -> Bools:
        """(C,) which ranks are known at 95 %."""
        return np.asarray((self.lowest == self.rank) & (self.highest == self.rank))


def rank_errors(inference: Inference) -> RankErrors:
    """The errors of an inference's ranking.

    A ranking of nothing sampled has none.
    """
    rank = inference.ranking.rank
    if inference.sampling is None:
        return RankErrors(rank, rank, rank, np.zeros(len(rank)))
    rankings = [
        replace(inference, avoidance=avoidance).ranking
        for avoidance in inference.sampling.replicates
    ]
    ranks = np.array([ranking.rank for ranking in rankings])
    gains = np.array([ranking.gain for ranking in rankings])
    tail = (1 - LEVEL) / 2
    lowest, highest = np.quantile(ranks, [tail, 1 - tail], axis=0, method="nearest")
    with np.errstate(invalid="ignore"):
        return RankErrors(rank, lowest, highest, np.std(gains, axis=0))


def infer_until_settled(
    model: SampledModel,
    demonstrations: Sequence[Demonstration],
    *,
    first: int = 1,
    most: int = 64_000,
    progress: Callable[[int, RankErrors], None] | None = None,
    **options: Any,
) -> tuple[Inference, RankErrors]:
    """Rank hypotheses with twice the samples until the first ranks are settled.

    Args:
        model: its samples are those of the first attempt.
        demonstrations: N demonstrations.
        first: so many hypotheses, by rank, are to be settled.
        most: samples of a task that are not exceeded, whether or not they are.
        progress: called after each attempt, with its samples.
        options: more of `mlci.infer`'s arguments.

    Returns:
        The last inference, and the errors of its ranking.
    """
    while True:
        inference = infer(model, demonstrations, **options)
        errors = rank_errors(inference)
        if progress is not None:
            progress(model.samples, errors)
        if np.all(errors.settled[inference.order[:first]]) or 2 * model.samples > most:
            return inference, errors
        model = replace(model, samples=2 * model.samples)
