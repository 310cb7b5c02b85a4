"""Ranking and posteriors against Bayes' rule written out, and against simulated truths."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.evidence import (
    Rates,
    confidence,
    decided_by_cell,
    log_evidence,
    posterior,
    printed_confidence,
    rank_constraints,
    rank_scores,
    total_gain,
)


def test_gain_is_one_factor_a_demonstration() -> None:
    """Two demonstrations with their own Phi: the most likely one is not where Z_C is smallest."""
    phi = np.array([[0.9, 0.6, 0.0], [0.0, 0.8, 0.0]])
    ranking = rank_constraints(1 - phi, np.zeros((2, 3), dtype=bool))
    np.testing.assert_allclose(
        ranking.gain, [np.log(10), np.log(1 / 0.4) + np.log(1 / 0.2), 0.0], rtol=1e-12
    )
    assert ranking.order.tolist() == [1, 0, 2]


def test_a_violated_hypothesis_is_infeasible_and_last() -> None:
    phi = np.array([[0.9, 0.5, 0.1, 0.2], [0.0, 0.0, 0.0, 0.0]])
    violated = np.array([[True, False, False, False], [False, False, False, True]])
    ranking = rank_constraints(1 - phi, violated)
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
    ranking = rank_constraints(1 - phi, violated, prior_none=0.4)
    np.testing.assert_allclose(ranking.posterior, (weight / weight.sum())[:3])
    assert ranking.posterior_none == pytest.approx(weight[3] / weight.sum())


def test_posterior_is_calibrated_over_simulated_truths() -> None:
    """Draw a truth from the prior, demonstrations from the truth; compare belief and frequency.

    Trajectories are rows of a 0/1 table with known probabilities, so that Phi is exact. Over
    1500 rounds each bin of 100 or more must agree to four standard errors.
    """
    rng = np.random.default_rng(0)
    trajectories = rng.random((12, 3)) < 0.3  # which of three regions each of 12 paths crosses
    chance = rng.dirichlet(np.ones(12))
    phi = chance @ trajectories
    beliefs, outcomes = [], []
    for _ in range(1500):
        truth = int(rng.choice(4, p=[0.15, 0.15, 0.2, 0.5]))
        allowed = np.ones(12, dtype=bool) if truth == 3 else ~trajectories[:, truth]
        count = int(rng.integers(0, 6))
        drawn = rng.choice(12, size=count, p=chance * allowed / np.sum(chance * allowed))
        ranking = rank_constraints(
            np.tile(1 - phi, (count, 1)), trajectories[drawn], 0.5, prior=[0.15, 0.15, 0.2]
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
    assert chance == pytest.approx(np.array([0.25, 0.0, 0.75, 0.0]), abs=0, rel=1e-15)
    assert none == 0.0


def test_posteriors_of_many_gains_are_those_of_each() -> None:
    gains = np.array([[[0.3, -np.inf, 2.0], [np.inf, 1.0, np.inf]], [[0, 0, 0], [-1, -2, -3.0]]])
    chances, none = posterior(gains, 0.3, prior=[1, 2, 1])
    for place in np.ndindex(2, 2):
        each, of_none = posterior(gains[place], 0.3, prior=[1, 2, 1])
        assert chances[place].tolist() == each.tolist()
        assert none[place] == of_none
    odds = np.array([0.175 * np.exp(0.3), 0, 0.175 * np.exp(2.0), 0.3])
    assert [*chances[0, 0], none[0, 0]] == pytest.approx((odds / odds.sum()).tolist(), rel=1e-14)


def test_confidence_of_a_hypothesis_fixed_in_advance() -> None:
    assert confidence(0.5, np.full(9, 0.8)) == pytest.approx(1 / (1 + 0.8**9))
    assert confidence(0.5, np.full(9, 0.8)) == pytest.approx(0.8817, abs=5e-5)
    assert confidence(0.3, []) == pytest.approx(0.3)
    assert confidence(0.0, [0.0]) == 0.0
    chance, _ = posterior(np.array([9 * np.log(1 / 0.8)]), prior_none=0.5)
    assert chance[0] == pytest.approx(confidence(0.5, np.full(9, 0.8)))


def test_errors_name_the_fault() -> None:
    with pytest.raises(ValueError, match=r"\(N, C\) each"):
        rank_constraints(np.zeros((2, 3)), np.zeros((2, 4), dtype=bool))
    with pytest.raises(ValueError, match=r"must lie in \[0, 1\]"):
        rank_constraints(np.full((1, 2), 1.1), np.zeros((1, 2), dtype=bool))
    with pytest.raises(ValueError, match="prior of no constraint"):
        posterior(np.zeros(2), prior_none=0.0)
    with pytest.raises(ValueError, match="weights >= 0"):
        posterior(np.zeros(2), prior=[1.0, -1.0])
    with pytest.raises(ValueError, match="weights >= 0 that are not all 0"):
        posterior(np.zeros(2), prior=[0.0, 0.0])
    with pytest.raises(ValueError, match=r"lies in \[0, 1\]"):
        confidence(1.5, [])


def test_printed_confidence_is_what_the_paper_prints() -> None:
    assert printed_confidence(0.5, [0.8] * 9) == pytest.approx(1.155, abs=5e-4)
    assert printed_confidence(0.9, [0.5]) == pytest.approx(0.9 / (0.9 - 0.1 * 0.5))
    assert printed_confidence(0.5, []) == np.inf
    assert printed_confidence(0.5, [1 - 1e-16]) == printed_confidence(0.5, [1 - 1e-12]) == np.inf
    assert printed_confidence(0.5, [1 - 1e-6]) == pytest.approx(1e6)
    assert np.isnan(printed_confidence(0.0, [0.0]))
    assert printed_confidence(0.0, [0.5]) == 0
    assert printed_confidence(0.2, [0.9]) == pytest.approx(0.2 / (0.2 - 0.8 * 0.9))
    assert printed_confidence(0.2, [0.9]) < 0
    with pytest.raises(ValueError, match=r"\[0, 1\], not 1.5"):
        printed_confidence(1.5, [0.1])


def test_nothing_saturates() -> None:
    """-log alpha is exact where 1 - alpha rounds to 1, and 0 is a named infinity."""
    alpha = np.array([[1e-16, 1e-30, 1e-300, 0.0, 1.0]])
    gain = rank_constraints(alpha, np.zeros((1, 5), dtype=bool)).gain
    np.testing.assert_allclose(gain[:3], np.log(10) * np.array([16, 30, 300]), rtol=1e-14)
    assert gain[3:].tolist() == [np.inf, 0.0]


def test_a_violation_excludes_whatever_another_demonstration_cannot_avoid() -> None:
    """+inf and -inf are no nan."""
    ranking = rank_constraints([[0.0], [0.5]], [[False], [True]])
    assert ranking.gain.tolist() == [-np.inf]
    assert ranking.posterior.tolist() == [0.0]
    assert total_gain(np.zeros((0, 3))).tolist() == [0, 0, 0]


def listed_ratio(alpha: float, violates: bool, eta: float, eps: float) -> float:
    """P(kind of demonstration | constraint) / P(the same | none), by listing who may have made it.

    A demonstrator obeys or not. Who does not is as free as without the constraint, and then avoids
    the region by chance, as the model says, or for reasons that the model does not know.
    """
    free = {False: (1 - eta) * alpha + eta, True: (1 - eta) * (1 - alpha)}
    obeying = {False: 1.0, True: 0.0}
    under = {kind: (1 - eps) * obeying[kind] + eps * free[kind] for kind in free}
    assert sum(free.values()) == pytest.approx(1)
    assert sum(under.values()) == pytest.approx(1)
    return under[violates] / free[violates]


@pytest.mark.parametrize("eta", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("eps", [0.0, 0.05, 0.3])
def test_rates_are_those_of_a_mixture_of_demonstrators(eta: float, eps: float) -> None:
    for alpha in (0.01, 0.3, 0.9):
        for violates in (False, True):
            with np.errstate(divide="ignore"):
                expected = np.log(listed_ratio(alpha, violates, eta, eps))
            evidence = log_evidence([[alpha]], [[violates]], Rates(eta, eps))
            assert evidence.item() == pytest.approx(expected, abs=1e-12)


def test_limits_of_the_rates() -> None:
    """One demonstration brings at most -log eta, and a violation costs log eps."""
    avoids, violates = np.zeros((1, 1), bool), np.ones((1, 1), bool)
    most = log_evidence([[0.0]], avoids, Rates(model_error=0.1)).item()
    assert most == pytest.approx(np.log(10))
    assert log_evidence([[0.3]], violates, Rates(rule_breaking=0.05)).item() == np.log(0.05)
    both = log_evidence([[0.0]], avoids, Rates(0.1, 0.05)).item()
    assert both == pytest.approx(np.log(0.95 / 0.1 + 0.05))
    for rates in (Rates(), Rates(0.2, 0.1)):
        assert log_evidence([[1.0]], avoids, rates).item() == pytest.approx(0.0, abs=1e-15)
    soft = rank_constraints([[0.5, 0.5]], [[True, False]], rates=Rates(rule_breaking=0.1))
    assert soft.feasible.tolist() == [False, True]
    assert soft.rank.tolist() == [2, 1]
    assert np.all(soft.posterior > 0)


@pytest.mark.parametrize("rate", [-0.1, 1.0, np.nan])
def test_a_rate_outside_its_range_is_refused(rate: float) -> None:
    with pytest.raises(ValueError, match=r"model_error must lie in \[0, 1\)"):
        Rates(model_error=rate)
    with pytest.raises(ValueError, match=r"rule_breaking must lie in \[0, 1\)"):
        Rates(rule_breaking=rate)


def test_a_cell_decides_what_is_certain_only_between_cells() -> None:
    between_cells = [[0.0, 2.7e-20, 6.7e-36, 9e-4, 0.0, 0.002, 0.5, 1.0]]
    between_states = [[0.3, 0.02, 1.0, 0.9, 1e-20, 0.9, 0.0, 1.0]]
    expected = [[True, True, True, True, False, False, False, False]]
    assert decided_by_cell(between_cells, between_states).tolist() == expected


def test_gains_that_differ_by_rounding_tie() -> None:
    """The same evidence summed in two orders, and what differs by more."""
    parts = np.array([0.1, 0.7, 0.3, 1e-3])
    one, other = sum(parts), sum(parts[::-1])
    assert 0 < abs(one - other) < 1e-14
    gain = np.array([one, other, one + 1e-8, -np.inf, np.inf, one, np.inf])
    for order in (np.arange(7), np.arange(7)[::-1]):
        rank = rank_scores(gain[order], np.ones(7, bool))
        assert rank.tolist() == np.array([5, 5, 3, 7, 1.5, 5, 1.5])[order].tolist()
    both = np.stack([gain, np.zeros(7)])
    feasible = np.arange(7) != 5
    ranks = rank_scores(both, feasible)
    assert ranks[0].tolist() == [4.5, 4.5, 3, 6.5, 1.5, 6.5, 1.5]
    assert ranks[1].tolist() == [3.5] * 5 + [7, 3.5]
    assert rank_scores(np.zeros((2, 0)), np.zeros((2, 0), bool)).shape == (2, 0)
