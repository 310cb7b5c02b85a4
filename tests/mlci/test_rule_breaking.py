"""The rate of rule breaking against a sum over who breaks rules, and over simulated worlds."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mlci.evidence import Rates, log_evidence, total_gain
from mlci.rule_breaking import RateEstimate, estimate_rule_breaking, gains_of_subsets
from mlci.spaces import Bools, Floats


def marginal(eps: float, alpha: Floats, violated: Bools, eta: float, prior_none: float) -> float:
    """M(eps), summed over hypotheses and over every set of demonstrators who break rules."""
    total, (count, regions) = prior_none, alpha.shape
    for i in range(regions):
        for breaks in itertools.product([False, True], repeat=count):
            term = (1 - prior_none) / regions
            for j, broken in enumerate(breaks):
                avoids = (1 - eta) * alpha[j, i] + eta
                term *= eps if broken else (1 - eps) * (not violated[j, i]) / avoids
            total += term
    return total


@pytest.mark.parametrize("seed", range(6))
def test_the_estimate_is_the_peak_of_the_sum_over_who_breaks_rules(seed: int) -> None:
    rng = np.random.default_rng(seed)
    alpha = rng.uniform(0.02, 0.6, (5, 2))
    violated = rng.random((5, 2)) < 0.3
    estimate = estimate_rule_breaking(alpha, violated, 0.05, 0.4)
    fine = np.linspace(0, 0.999, 1000)
    sums = np.array([marginal(eps, alpha, violated, 0.05, 0.4) for eps in fine])
    assert estimate.rate == pytest.approx(fine[np.argmax(sums)], abs=0.002)
    # 1.9207: half of the quantile of chi^2 with one degree of freedom at 95 %.
    inside = fine[2 * np.log(sums.max() / sums) <= 2 * 1.9207]
    assert estimate.lower == pytest.approx(inside[0], abs=0.002)
    assert estimate.upper == pytest.approx(inside[-1], abs=0.002)


@pytest.mark.long
def test_the_interval_covers_the_rate_in_simulated_worlds() -> None:
    """95 % intervals over 120 worlds: 89 % is three standard errors below."""
    rng, covered, rates, eps = np.random.default_rng(1), [], [], 0.15
    for _ in range(120):
        paths = rng.random((40, 6)) < 0.5  # which of six regions each of 40 paths crosses
        chance = rng.dirichlet(np.ones(40))
        truth = int(rng.integers(6))
        lawful = chance * ~paths[:, truth] / np.sum(chance * ~paths[:, truth])
        drawn = rng.choice(40, 60, p=(1 - eps) * lawful + eps * chance)
        alpha = np.tile(1 - chance @ paths, (60, 1))
        estimate = estimate_rule_breaking(alpha, paths[drawn])
        covered.append(estimate.lower <= eps <= estimate.upper)
        rates.append(estimate.rate)
    assert 0.89 <= np.mean(covered) <= 0.99
    assert np.median(rates) == pytest.approx(eps, abs=0.03)


def test_nothing_is_known_where_nothing_speaks() -> None:
    silent = estimate_rule_breaking(np.ones((8, 3)), np.zeros((8, 3), dtype=bool))
    assert (silent.lower, silent.upper) == (0.0, 1.0)
    assert estimate_rule_breaking(np.ones((0, 3)), np.zeros((0, 3), dtype=bool)) == silent


def test_nobody_breaks_a_rule_that_all_keep() -> None:
    """Also where the tabular agent cannot keep it, and its gain would be infinite."""
    for alpha in (0.3, 0.0):
        kept = estimate_rule_breaking(np.full((20, 1), alpha), np.zeros((20, 1), dtype=bool))
        assert kept.rate == kept.lower == 0
        assert 0 < kept.upper < 0.3


def test_an_estimate_is_read_with_its_interval() -> None:
    assert str(RateEstimate(0.1, 0.0312, 0.25)) == "0.1 (0.0312 to 0.25)"


def test_gains_of_subsets_are_those_of_each_one_estimated_alone() -> None:
    rng = np.random.default_rng(7)
    alpha = rng.uniform(0.02, 0.6, (12, 4))
    violated = rng.random((12, 4)) < [0.1, 0.5, 0.2, 0.9]
    subsets = np.array([rng.choice(12, 8, replace=False) for _ in range(10)])
    gains = gains_of_subsets(alpha, violated, subsets, 0.05, 0.4)
    rates = []
    for subset, gain in zip(subsets, gains, strict=True):
        estimate = estimate_rule_breaking(alpha[subset], violated[subset], 0.05, 0.4)
        rates.append(estimate.rate)
        exact = total_gain(
            log_evidence(alpha[subset], violated[subset], Rates(0.05, estimate.rate))
        )
        # The grid is within 0.01 of the estimate, where M is flat and the best gain nearly so.
        assert np.max(gain) == pytest.approx(np.max(exact), abs=0.05)
        assert np.argsort(gain).tolist() == np.argsort(exact).tolist()
    assert np.ptp(rates) > 0.05
