"""The fitted rule, against scipy's minimiser, and what leaving out must leave out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from mlci.outlook.rule import brier_scores, choose_features, fit_rule, left_out, left_out_choice


def cases(count: int = 120) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Features of which the second tells of success, and six groups."""
    rng = np.random.default_rng(0)
    features = rng.normal(size=(count, 4)) * [1.0, 3.0, 0.1, 1.0] + [0.0, 5.0, 0.0, 2.0]
    chance = 1 / (1 + np.exp(-(features[:, 1] - 5.0)))
    return features, rng.binomial(5, chance) / 5, np.arange(count) % 6


def test_the_weights_are_those_of_the_greatest_penalised_likelihood() -> None:
    features, success, _ = cases()
    rule = fit_rule(features, success, ridge=2.0)
    z = (features - features.mean(axis=0)) / features.std(axis=0)

    def loss(w: np.ndarray) -> float:
        logits = w[0] + z @ w[1:]
        return float(np.sum(np.logaddexp(0, logits) - success * logits) + np.sum(w[1:] ** 2))

    best = minimize(loss, np.zeros(5), method="BFGS", options={"gtol": 1e-8}).x
    np.testing.assert_allclose([rule.intercept, *rule.weights], best, atol=1e-5)
    foretold = 1 / (1 + np.exp(-best[0] - z @ best[1:]))
    np.testing.assert_allclose(rule.probability(features), foretold, atol=1e-5)


def test_success_that_one_feature_decides_has_finite_weights() -> None:
    features = np.linspace(-1, 1, 40)[:, None]
    rule = fit_rule(features, (features[:, 0] > 0).astype(float))
    assert 1 < rule.weights[0] < 10
    everything = fit_rule(features, np.ones(40))
    assert np.all(everything.probability(features) > 0.9)


def test_a_rule_without_features_says_the_base_rate() -> None:
    rule = fit_rule(np.zeros((4, 0)), [0.0, 1.0, 1.0, 0.5])
    np.testing.assert_allclose(rule.probability(np.zeros((3, 0))), 0.625, atol=1e-6)
    constant = fit_rule(np.ones((4, 1)), [0.0, 1.0, 1.0, 0.5])
    np.testing.assert_allclose(constant.probability([[1.0]]), 0.625, atol=1e-6)


@pytest.mark.parametrize("foretell", [left_out, lambda *them: left_out_choice(*them, 2)])
def test_what_is_left_out_has_no_part_in_its_own_forecast(foretell) -> None:
    features, success, groups = cases()
    before, changed = foretell(features, success, groups), success.copy()
    changed[groups == 2] = 1 - changed[groups == 2]
    after = foretell(features, changed, groups)
    np.testing.assert_array_equal(before[groups == 2], after[groups == 2])
    assert np.abs(before - after)[groups != 2].min() > 0


def test_the_feature_that_tells_is_chosen_and_none_where_none_does() -> None:
    features, success, groups = cases()
    assert choose_features(features, success, groups, most=1) == [1]
    assert choose_features(features, success, groups, most=4) == [1]  # others add nothing to it
    assert choose_features(features, success, groups, most=2, first=[3]) == [3, 1]
    assert choose_features(features, success, np.zeros(120), most=2, first=[3]) == [3]
    rng = np.random.default_rng(1)
    shuffled = rng.permutation(success)
    assert choose_features(features[:, [0, 2, 3]], shuffled, groups, most=2, least=0.01) == []


def test_the_score_is_the_mean_over_trials() -> None:
    trials = np.array([[1, 1, 0, 1, 0], [0, 0, 0, 0, 0]])
    chance = np.array([0.7, 0.2])
    expected = np.mean((chance[:, None] - trials) ** 2, axis=1)
    np.testing.assert_allclose(brier_scores(chance, trials.mean(axis=1)), expected)


@pytest.mark.parametrize(
    ("features", "success", "message"),
    [
        (np.zeros((3, 2)), np.zeros(2), r"do not agree: \(3, 2\), \(2,\)"),
        (np.zeros((0, 2)), np.zeros(0), "do not agree"),
        (np.full((2, 1), np.nan), np.zeros(2), "features must be finite"),
        (np.zeros((2, 1)), np.array([0.0, 1.5]), "success between 0 and 1"),
    ],
)
def test_what_is_no_case_is_refused(features, success, message) -> None:
    with pytest.raises(ValueError, match=message):
        fit_rule(features, success)


def test_numbers_that_fit_nothing_are_refused() -> None:
    features, success, groups = cases()
    for ridge in (-1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=f"a ridge is a finite price .*, not {ridge}"):
            fit_rule(features, success, ridge)
    with pytest.raises(ValueError, match="too large to be standardised: up to"):
        fit_rule(features * 1e300, success)
    for foretell in (left_out, lambda *them: left_out_choice(*them, 2)):
        for wrong in (groups[1:], np.zeros(len(success))):
            with pytest.raises(ValueError, match="120 cases need a group each, of two or more"):
                foretell(features, success, wrong)
