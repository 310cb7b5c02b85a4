"""Ranking and posteriors against Bayes' rule written out, and against simulated truths."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.evidence import (
    confidence,
    log_likelihood_gain,
    posterior,
    printed_confidence,
    rank_constraints,
    rank_scores,
)


def test_gain_is_one_factor_a_demonstration() -> None:
    """Two demonstrations with their own Phi: the most likely one is not where Z_C is smallest."""
    phi = np.array([[0.9, 0.6, 0.0], [0.0, 0.8, 0.0]])
    ranking = rank_constraints(phi, np.zeros((2, 3), dtype=bool))
    np.testing.assert_allclose(
        ranking.gain, [np.log(10), np.log(1 / 0.4) + np.log(1 / 0.2), 0.0], rtol=1e-12
    )
    assert ranking.order.tolist() == [1, 0, 2]


def test_a_violated_hypothesis_is_infeasible_and_last() -> None:
    phi = np.array([[0.9, 0.5, 0.1, 0.2]])
    violated = np.array([[True, False, False, False], [False, False, False, True]])
    ranking = rank_constraints(phi, violated)
    assert ranking.feasible.tolist() == [False, True, True, False]
    assert ranking.rank.tolist() == [3.5, 1.0, 2.0, 3.5]
    assert ranking.order.tolist() == [1, 2, 0, 3]
    assert ranking.posterior[0] == ranking.posterior[3] == 0
    assert ranking.gain[0] == -np.inf


def test_ties_share_their_mean_rank() -> None:
    assert rank_scores([0.0, 2.0, 0.0, 0.0], np.ones(4, dtype=bool)).tolist() == [3, 1, 3, 3]


def test_posterior_is_the_prior_without_demonstrations() -> None:
    chance, none = posterior(np.zeros(4), prior_none=0.3, prior=[1, 2, 3, 4])
    np.testing.assert_allclose(chance, 0.7 * np.array([0.1, 0.2, 0.3, 0.4]))
    assert none == pytest.approx(0.3)


def test_posterior_is_bayes_rule() -> None:
    phi = np.array([[0.2, 0.7, 0.4], [0.5, 0.1, 0.3]])
    violated = np.array([[False, False, True], [False, False, False]])
    likelihood = np.append(np.prod(1 / (1 - phi), axis=0) * ~violated.any(axis=0), 1.0)
    weight = np.append([0.2] * 3, 0.4) * likelihood
    ranking = rank_constraints(phi, violated, prior_none=0.4)
    np.testing.assert_allclose(ranking.posterior, (weight / weight.sum())[:3])
    assert ranking.posterior_none == pytest.approx(weight[3] / weight.sum())


def test_posterior_is_calibrated_over_simulated_truths() -> None:
    """Draw a truth from the prior, demonstrations from the truth; compare belief and frequency.

    Trajectories are rows of a 0/1 table with known probabilities, so that Phi is exact. Over
    4000 rounds each bin of 100 or more must agree to four standard errors.
    """
    rng = np.random.default_rng(0)
    trajectories = rng.random((12, 3)) < 0.3  # which of three regions each of 12 paths crosses
    chance = rng.dirichlet(np.ones(12))
    phi = chance @ trajectories
    beliefs, outcomes = [], []
    for _ in range(4000):
        truth = int(rng.choice(4, p=[0.15, 0.15, 0.2, 0.5]))
        allowed = np.ones(12, dtype=bool) if truth == 3 else ~trajectories[:, truth]
        count = int(rng.integers(0, 6))
        drawn = rng.choice(12, size=count, p=chance * allowed / np.sum(chance * allowed))
        ranking = rank_constraints(
            np.tile(phi, (count, 1)), trajectories[drawn], 0.5, prior=[0.15, 0.15, 0.2]
        )
        beliefs.extend([*ranking.posterior, ranking.posterior_none])
        outcomes.extend(np.arange(4) == truth)
    bins = np.minimum((np.array(beliefs) * 10).astype(int), 9)
    for b in range(10):
        here = bins == b
        if np.sum(here) >= 100:
            p = np.mean(np.array(beliefs)[here])
            error = np.sqrt(max(p * (1 - p), 1e-4) / np.sum(here))
            assert abs(np.mean(np.array(outcomes)[here]) - p) < 4 * error


def test_an_infinite_gain_takes_all_probability() -> None:
    chance, none = posterior(np.array([np.inf, 3.0, np.inf, -np.inf]), prior=[1, 1, 3, 1])
    assert chance.tolist() == [0.25, 0.0, 0.75, 0.0]
    assert none == 0.0
    assert log_likelihood_gain([1.0]).tolist() == [np.inf]


def test_confidence_of_a_hypothesis_fixed_in_advance() -> None:
    assert confidence(0.5, np.full(9, 0.2)) == pytest.approx(1 / (1 + 0.8**9))
    assert confidence(0.5, np.full(9, 0.2)) == pytest.approx(0.8817, abs=5e-5)
    assert confidence(0.3, []) == pytest.approx(0.3)
    assert confidence(0.0, [1.0]) == 0.0
    chance, _ = posterior(np.array([9 * np.log(1 / 0.8)]), prior_none=0.5)
    assert chance[0] == pytest.approx(confidence(0.5, np.full(9, 0.2)))


def test_errors_name_the_fault() -> None:
    with pytest.raises(ValueError, match=r"\(N, C\) each"):
        rank_constraints(np.zeros((2, 3)), np.zeros((2, 4), dtype=bool))
    with pytest.raises(ValueError, match=r"must lie in \[0, 1\]"):
        rank_constraints(np.full((1, 2), 1.1), np.zeros((1, 2), dtype=bool))
    with pytest.raises(ValueError, match="prior of no constraint"):
        posterior(np.zeros(2), prior_none=0.0)
    with pytest.raises(ValueError, match="weights >= 0"):
        posterior(np.zeros(2), prior=[1.0, -1.0])
    with pytest.raises(ValueError, match=r"lies in \[0, 1\]"):
        confidence(1.5, [])


def test_printed_confidence_is_what_the_paper_prints() -> None:
    assert printed_confidence(0.5, [0.2] * 9) == pytest.approx(1.155, abs=5e-4)
    assert printed_confidence(0.9, [0.5]) == pytest.approx(0.9 / (0.9 - 0.1 * 0.5))
    assert printed_confidence(0.5, []) == np.inf
    assert printed_confidence(0.2, [0.1]) == pytest.approx(0.2 / (0.2 - 0.8 * 0.9))
    assert printed_confidence(0.2, [0.1]) < 0
    with pytest.raises(ValueError, match=r"\[0, 1\], not 1.5"):
        printed_confidence(1.5, [0.1])
