"""The same demonstrations of one world read with different kinds of evidence.

Whether probabilities come true, and how probable the truth becomes, says which kind to trust.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from mlci.calibration import Calibration
from mlci.evidence import PAPER, Rates
from mlci.inference import Inference
from mlci.preparation import infer

FIXED_RATES = (0.05, 0.1, 0.2)
COLUMNS = ["prior", "sets", "set", "demonstrations", "evidence", "best", "right", "of_truth", "top"]
COLUMNS += ["feasible"]


def evidence_table(
    settings: Settings, point: PointInference, calibration: Calibration
) -> pd.DataFrame:
    """A row a set, number of demonstrations and kind of evidence.

    Sets of one size share no demonstration, and there are as many of them as there can be.

    Args:
        settings: the point; its truth is one hypothesis, or nothing.
        point: what its demonstrations say, with exact ends.
        calibration: of the forecasts with exact ends.

    Returns:
        `prior` of the world, its number of `sets` of that size; `set`, `demonstrations`,
        `evidence`; `best`, the posterior of the most likely hypothesis, and whether it is `right`;
        `of_truth`, the posterior of what is true; whether the truth is in the `top`, nothing where
        nothing is forbidden; how many hypotheses are still `feasible`.
    """
    kinds, cell = _kinds(settings, point, calibration), settings.truth.cell
    hypotheses, prior_none = len(point.inference.hypotheses), point.inference.prior_none
    prior = prior_none if cell is None else (1 - prior_none) / hypotheses
    rows = []
    for count in settings.calibration.demonstrations:
        sets = len(point.inference.names) // count
        for number, first in enumerate(range(0, sets * count, count)):
            for kind, inference in kinds.items():
                ranking = inference.of(slice(first, first + count)).ranking
                best = int(ranking.order[0])
                rows.append(
                    {
                        "prior": prior,
                        "sets": sets,
                        "set": number,
                        "demonstrations": count,
                        "evidence": kind,
                        "best": ranking.posterior[best],
                        "right": int(best == cell),
                        "of_truth": ranking.posterior_none
                        if cell is None
                        else ranking.posterior[cell],
                        "top": np.nan
                        if cell is None
                        else int(ranking.rank[cell] <= settings.ranks.top),
                        "feasible": int(np.sum(ranking.feasible)),
                    }
                )
    return pd.DataFrame(rows, columns=COLUMNS)


def _kinds(
    settings: Settings, point: PointInference, calibration: Calibration
) -> dict[str, Inference]:
    """The inference of all demonstrations with each kind of evidence."""
    exact = replace(point.inference, rates=PAPER, calibration=None)
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
