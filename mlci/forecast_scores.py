"""Scores of forecasts: what is said to happen with some probability against what happens.

A forecast is 1 - alpha, for a pair of a task and a region. Pairs of one task go together, so that
intervals are of a bootstrap over tasks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mlci.forecasts import checked_forecasts
from mlci.spaces import Bools, Floats, Ints

if TYPE_CHECKING:
    import pandas as pd

# Forecasts are counted between these probabilities of crossing.
EDGES = (0.0, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
BIN_COLUMNS = ("lower", "upper", "count", "forecast", "crossed", "low", "high")
_DECIMALS = 9  # of a forecast that is put into a bin: what differs beyond is rounding
_RESAMPLES, _TAILS = 1000, (0.025, 0.975)  # of a 95 % interval


@dataclass(frozen=True)
class Score:
    """A mean over pairs, with its 95 % interval over tasks."""

    mean: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class ForecastScores:
    """How good forecasts of crossing are.

    Attributes:
        log_score: mean log probability of what happened [nat]; the larger the better, -inf where
            something happened that was called impossible.
        brier: mean squared difference between a forecast and what happened; the smaller the better.
        off_by: mean over forecasts of the distance between a bin's mean forecast and the share that
            was crossed, the expected calibration error.
        bins: a row a bin that holds forecasts: `lower`, `upper`; `count`; `forecast`, their mean;
            `crossed`, the share that was, with `low` and `high`.
    """

    log_score: Score
    brier: Score
    off_by: float
    bins: pd.DataFrame


def score_forecasts(
    avoidance: ArrayLike, violated: ArrayLike, counts: ArrayLike, seed: int = 0
) -> ForecastScores:
    """Judge forecasts; intervals are of a bootstrap over tasks, whose pairs go together.

    Args:
        avoidance: (N, C) alpha, calibrated or not.
        violated: (N, C) which regions each demonstration crosses.
        counts: (N, C) which pairs count.
        seed: of the bootstrap.

    Raises:
        ValueError: shapes that disagree, or no pair that counts.
    """
    import pandas as pd

    alpha, crossed = checked_forecasts(avoidance, violated)
    use = np.asarray(counts, dtype=bool)
    if not use.any():
        raise ValueError("no pair of a demonstration and a region counts: nothing to score")
    draws = np.random.default_rng(seed).integers(0, len(alpha), (_RESAMPLES, len(alpha)))
    times = np.stack([np.bincount(row, minlength=len(alpha)) for row in draws])  # (B, N)
    with np.errstate(divide="ignore"):
        log_scores = np.log(np.where(crossed, 1 - alpha, alpha))
    brier = (1 - alpha - crossed) ** 2
    forecast = np.round(1 - alpha, _DECIMALS)
    place = np.clip(np.searchsorted(EDGES, forecast, side="right"), 1, len(EDGES) - 1)
    rows = []
    for number in np.unique(place[use]):
        inside = use & (place == number)
        share = _mean(crossed, inside, times)
        rows.append(
            {
                "lower": EDGES[number - 1],
                "upper": EDGES[number],
                "count": int(np.sum(inside)),
                "forecast": float(np.mean(1 - alpha[inside])),
                "crossed": share.mean,
                "low": share.low,
                "high": share.high,
            }
        )
    bins = pd.DataFrame(rows, columns=list(BIN_COLUMNS))
    distance = (bins["forecast"] - bins["crossed"]).abs()
    return ForecastScores(
        _mean(log_scores, use, times),
        _mean(brier, use, times),
        float(np.average(distance, weights=bins["count"])),
        bins,
    )


def _mean(values: Floats | Bools, use: Bools, times: Ints) -> Score:
    """Mean of the values (N, C) that are used, and its interval over resamples (B, N) of tasks."""
    totals, counts = np.sum(np.where(use, values, 0.0), axis=1), np.sum(use, axis=1)
    if not np.all(np.isfinite(totals)):
        return Score(-np.inf, -np.inf, -np.inf)
    with np.errstate(invalid="ignore"):  # a resample may use nothing
        shares = (times @ totals) / (times @ counts)
    low, high = np.nanquantile(shares, _TAILS)
    return Score(float(np.sum(totals) / np.sum(counts)), float(low), float(high))
