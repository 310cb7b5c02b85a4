"""Scores of forecasts against sums by hand and resamples that are written out."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.forecast_scores import score_forecasts

ALPHA = np.array([[0.88, 0.5, 1.0], [0.92, 0.45, 0.2]])
CROSSED = np.array([[False, True, False], [True, False, True]])
COUNTS = np.array([[True, True, False], [True, True, True]])


def test_scores_are_means_over_the_pairs_that_count() -> None:
    scores = score_forecasts(ALPHA, CROSSED, COUNTS)
    assert scores.log_score.mean == pytest.approx(
        np.mean(np.log([0.88, 0.5, 0.08, 0.45, 0.8])), rel=1e-12
    )
    assert scores.brier.mean == pytest.approx(
        np.mean([0.12**2, 0.5**2, 0.92**2, 0.55**2, 0.2**2]), rel=1e-12
    )


def test_bins_compare_forecasts_with_what_happened() -> None:
    scores = score_forecasts(ALPHA, CROSSED, COUNTS)
    bins = scores.bins
    assert bins["lower"].tolist() == [0.05, 0.1, 0.5, 0.8]
    assert bins["count"].tolist() == [1, 1, 2, 1]
    assert bins["forecast"].tolist() == pytest.approx([0.08, 0.12, 0.525, 0.8])
    assert bins["crossed"].tolist() == [1, 0, 0.5, 1]
    assert scores.off_by == pytest.approx((0.92 + 0.12 + 2 * 0.025 + 0.2) / 5)


def test_intervals_are_over_tasks() -> None:
    rng = np.random.default_rng(1)
    alpha = rng.random((15, 4))
    crossed, counts = rng.random((15, 4)) > alpha, rng.random((15, 4)) < 0.8
    scores = score_forecasts(alpha, crossed, counts, seed=5)
    draws = np.random.default_rng(5).integers(0, 15, (1000, 15))
    brier = (1 - alpha - crossed) ** 2
    means = [np.mean(brier[tasks][counts[tasks]]) for tasks in draws]
    expected = np.quantile(means, [0.025, 0.975])
    assert [scores.brier.low, scores.brier.high] == pytest.approx(expected.tolist())


def test_the_impossible_scores_minus_infinity() -> None:
    crossed = np.array([[True], [False]])
    assert score_forecasts([[1.0], [0.5]], crossed, [[True], [True]]).log_score.mean == -np.inf
    assert score_forecasts([[1.0], [0.5]], crossed, [[False], [True]]).log_score.mean > -1


def test_nothing_to_score_is_said() -> None:
    with pytest.raises(ValueError, match="nothing to score"):
        score_forecasts(ALPHA, CROSSED, np.zeros((2, 3), dtype=bool))


def test_a_forecast_that_is_an_edge_but_for_rounding_stands_above_it() -> None:
    alpha = np.array([[0.9], [np.nextafter(0.9, 0)], [np.nextafter(0.9, 1)]])
    scores = score_forecasts(alpha, np.zeros((3, 1)), np.ones((3, 1)))
    assert scores.bins[["lower", "count"]].to_numpy().tolist() == [[0.1, 3.0]]
