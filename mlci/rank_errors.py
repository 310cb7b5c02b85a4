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
from mlci.json_numbers import finite
from mlci.preparation import infer
from mlci.sampled.model import SampledModel
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import Progress

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

    def summary(self, order: Ints, names: Sequence[str]) -> str:
        """Which of the first ranks are settled, in words.

        Args:
            order: (C,) hypotheses from the most likely to the least.
            names: (C,) their names.
        """
        settled = self.settled[order]
        first = int(np.argmin(settled)) if not settled.all() else len(settled)
        level = f"{100 * LEVEL:g} %"
        if first == len(order):
            return f"all {first} ranks are settled at {level}"
        held = f"ranks 1-{first} are" if first > 1 else "rank 1 is" if first else "no rank is"
        told = "" if first else " from the first on"
        unsure = order[first]
        low, high = (f"{end[unsure]:g}" for end in (self.lowest, self.highest))
        return (
            f"{held} settled at {level}{told}; region {names[unsure]}, at rank "
            f"{self.rank[unsure]:g}, may have any from {low} to {high}"
        )


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


def sampling_record(inference: Inference, errors: RankErrors) -> dict[str, Any]:
    """What samples leave open, for programs: fit for JSON.

    Returns:
        `settled`, regions whose rank is, in their order; `summary`; `effective` samples of each
        demonstration; and for each region its `rank` from `lowest` to `highest`, standard error of
        its `gain`, the largest of its `phi` over the demonstrations, and whether some
        demonstration's samples `resolve` its Phi.

    Raises:
        ValueError: nothing of the inference is sampled.
    """
    sampling, names = inference.sampling, inference.hypotheses.names
    if sampling is None:
        raise ValueError("nothing of this inference is sampled: it has no errors of samples")
    resolved = ~np.all(sampling.unresolved(inference.avoidance), axis=0)
    largest = np.max(sampling.errors, axis=0, initial=0.0)
    return {
        "level": LEVEL,
        "summary": errors.summary(inference.order, names),
        "settled": [names[i] for i in inference.order if errors.settled[i]],
        "effective": dict(zip(inference.names, map(float, sampling.effective), strict=True)),
        "regions": {
            names[i]: {
                "rank": float(errors.rank[i]),
                "lowest": float(errors.lowest[i]),
                "highest": float(errors.highest[i]),
                "gain_error": finite(errors.gain_error[i]),
                "phi_error": float(largest[i]),
                "resolved": bool(resolved[i]),
            }
            for i in inference.order.tolist()
        },
    }


def infer_until_settled(
    model: SampledModel,
    demonstrations: Sequence[Demonstration],
    *,
    first: int = 1,
    most: int = 64_000,
    progress: Callable[[int, RankErrors], None] | None = None,
    task_progress: Progress | None = None,
    **options: Any,
) -> tuple[Inference, RankErrors]:
    """Rank hypotheses with twice the samples until the first ranks are settled.

    Args:
        model: its samples are those of the first attempt.
        demonstrations: N demonstrations.
        first: so many hypotheses, by rank, are to be settled.
        most: samples of a task that are not exceeded, whether or not they are.
        progress: called after each attempt, with its samples.
        task_progress: called within each, as `mlci.infer` calls its `progress`.
        options: more of `mlci.infer`'s arguments.

    Returns:
        The last inference, and the errors of its ranking.

    Raises:
        ValueError: numbers of ranks or samples that are not whole, or below 0.
    """
    for name, number in (("first", first), ("most", most)):
        if not isinstance(number, int | np.integer) or number < 0:
            raise ValueError(f"{name} is a whole number of at least 0, not {number}")
    while True:
        inference = infer(model, demonstrations, progress=task_progress, **options)
        errors = rank_errors(inference)
        if progress is not None:
            progress(model.samples, errors)
        if np.all(errors.settled[inference.order[:first]]) or 2 * model.samples > most:
            return inference, errors
        model = replace(model, samples=2 * model.samples)
