"""The same demonstrations of one world read with different kinds of evidence.

Whether probabilities come true, and how probable the truth becomes, says which kind to trust.

A score is the mean over all sets of so many of the world's demonstrations, of which random ones are
taken. Any set has the same expected score, so that the mean estimates the same as over disjoint
sets, but more precisely: a U-statistic. Sets that share demonstrations resemble each other, and so
intervals are over worlds (`experiments.collate.evidence_kinds`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.belief_counts import bins_of
from experiments.point.inference import PointInference
from experiments.point.streams import Purpose, stream
from mlci.calibration import Calibration
from mlci.evidence import PAPER, Rates, posterior, rank_scores, total_gain
from mlci.inference import Inference
from mlci.metrics import random_subsets
from mlci.preparation import infer
from mlci.spaces import Ints

FIXED_RATES = (0.05, 0.1, 0.2)
SETS = 100  # of each size
LEAST = 1e-10  # a posterior below counts as this, where its logarithm is averaged
COLUMNS = ["prior", "sets", "demonstrations", "evidence", "bin", "count", "best", "right"]
COLUMNS += ["log_truth", "top"]


def evidence_table(
    settings: Settings, point: PointInference, calibration: Calibration
) -> pd.DataFrame:
    """A row a number of demonstrations, kind of evidence and bin of the best hypothesis' posterior.

    Args:
        settings: the point; its truth is one hypothesis, or nothing.
        point: what its demonstrations say, with exact ends.
        calibration: of the forecasts with exact ends.

    Returns:
        `prior` of the world, how many `sets` of each size; `demonstrations`, `evidence`, `bin`; of
        the sets in that bin their `count`, and the sums of: `best`, the posterior of the most
        likely hypothesis; whether it is `right`; `log_truth`, the log posterior of what is true,
        LEAST at least; whether the truth is in the `top`, nothing where nothing is forbidden.
    """
    cell, sizes = settings.truth.number, settings.calibration.demonstrations
    hypotheses, prior_none = len(point.inference.hypotheses), point.inference.prior_none
    prior = prior_none if cell is None else (1 - prior_none) / hypotheses
    rng = stream(settings.seed, Purpose.EVIDENCE, 0 if cell is None else cell + 1)
    subsets = random_subsets(len(point.inference.names), max(sizes), SETS, rng)
    kinds, rows = _kinds(settings, point, calibration), []
    for size in sizes:
        for kind, inference in kinds.items() if size <= len(subsets) else ():
            opening = {"prior": prior, "sets": SETS, "demonstrations": size, "evidence": kind}
            for counted in _binned(inference, subsets[size - 1], cell, settings.ranks.top):
                rows.append({**opening, **counted})
    return pd.DataFrame(rows, columns=COLUMNS)


def _binned(
    inference: Inference, subsets: Ints, cell: int | None, top: int
) -> Iterator[dict[str, float]]:
    """What subsets (B, k) of demonstrations say of a truth, summed over each bin."""
    gains = total_gain(inference.evidence[subsets])
    rank = rank_scores(gains, gains > -np.inf)
    each, none = posterior(gains, inference.prior_none)
    first = np.argmin(rank, axis=1)  # of those that tie, the first by number
    best = np.take_along_axis(each, first[:, None], axis=1)[:, 0]
    of_truth = none if cell is None else each[:, cell]
    values = {
        "best": best,
        "right": first == (-1 if cell is None else cell),
        "log_truth": np.log(np.maximum(of_truth, LEAST)),
        "top": np.full(len(best), np.nan) if cell is None else rank[:, cell] <= top,
    }
    place = bins_of(best)
    for number in np.unique(place):
        inside = place == number
        sums = {name: float(np.sum(value[inside])) for name, value in values.items()}
        yield {"bin": int(number), "count": int(np.sum(inside)), **sums}


def _kinds(
    settings: Settings, point: PointInference, calibration: Calibration
) -> dict[str, Inference]:
    """The inference of all demonstrations with each kind of evidence."""
    exact = replace(point.inference, rates=PAPER, calibration=None, rule_breaking=None)
    kinds = {
        "paper": infer(
            point.model,
            point.demonstrations,
            hypotheses=point.hypotheses,
            prior_none=settings.inference.prior,
            rates=PAPER,
            exact_ends=False,
            tolerance=np.inf,
        ),
        "exact ends": exact,
    }
    for rate in FIXED_RATES:
        kinds[f"model error {rate}"] = replace(exact, rates=Rates(rate))
    if calibration.map is not None:
        kinds["calibrated"] = replace(exact, calibration=calibration.map)
    return kinds
