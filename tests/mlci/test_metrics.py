"""The study's measures by hand, and what the tabular model's own samples must give."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest

from mlci.evidence import log_evidence, posterior, rank_constraints, rank_scores, total_gain
from mlci.metrics import (
    claims,
    final_state_error,
    random_subsets,
    top_chances,
    truth_ranks,
    violation_distance,
)
from mlci.spaces import Box
from mlci.systems import Pendulum


def test_final_state_error_is_normalised_and_wraps() -> None:
    space = Pendulum().space
    goal = Box.point([0.1, 1.0])
    error = final_state_error(space, np.array([[0.1 + 6 * np.pi, 1.0], [-0.2, 4.0]]), goal)
    np.testing.assert_allclose(error, [0.0, np.hypot(0.3 / (2 * np.pi), 3.0 / 12)], atol=1e-12)
    free = Box(np.array([0.0, -np.inf]), np.array([0.2, np.inf]))
    assert final_state_error(space, np.array([0.5, 5.0]), free) == pytest.approx(0.3 / (2 * np.pi))


def test_violation_distance_has_its_floor_when_the_model_is_true() -> None:
    """Demonstrations drawn from Phi: `each` averages to the floor, `pooled` goes to 0."""
    rng = np.random.default_rng(0)
    phi = np.tile(rng.random(20), (4000, 1))
    distance = violation_distance(phi, rng.random(phi.shape) < phi)
    spread = np.std(distance.each) / np.sqrt(len(phi))
    assert abs(np.mean(distance.each) - np.mean(distance.floor)) < 4 * spread
    assert distance.pooled < 20 * 4 * 0.5 / np.sqrt(len(phi))


def test_violation_distance_by_hand() -> None:
    distance = violation_distance([[0.5, 1.0], [0.1, 0.0]], [[True, False], [False, False]])
    np.testing.assert_allclose(distance.each, [1.5, 0.1])
    np.testing.assert_allclose(distance.floor, [0.5, 0.18])
    # On average -0.2 and 0.5 from what was observed.
    np.testing.assert_allclose(distance.shares, [0.5 + 1.0, -0.1])
    assert distance.pooled == pytest.approx(0.2 + 0.5)


def ranks_of(gains: np.ndarray) -> np.ndarray:
    """(B, C) where each hypothesis is in each of B rankings."""
    return rank_scores(gains, gains > -np.inf)


def test_random_subsets_are_nested_and_distinct() -> None:
    subsets = random_subsets(8, 20, 5, np.random.default_rng(0))
    assert [part.shape for part in subsets] == [(5, size) for size in range(1, 9)]
    for smaller, larger in itertools.pairwise(subsets):
        np.testing.assert_array_equal(larger[:, :-1], smaller)
    assert all(len(set(row)) == 8 for row in subsets[-1].tolist())


def test_a_truth_that_covers_no_hypothesis_has_no_rank() -> None:
    ranks = truth_ranks(np.array([[1.0, 2.0]]), np.array([False, False]))
    assert np.isnan(ranks).tolist() == [True]


def test_truth_ranks_equal_ranking_each_subset_alone() -> None:
    rng = np.random.default_rng(1)
    phi = rng.random((12, 7)) * (rng.random((12, 7)) < 0.5)
    violated = rng.random((12, 7)) < 0.05
    truth = np.array([False, True, False, False, True, False, False])
    for subsets in random_subsets(12, 6, 9, rng):
        gains = total_gain(log_evidence(1 - phi, violated)[subsets])
        ranks = truth_ranks(ranks_of(gains), truth)
        alone = [rank_constraints(1 - phi[s], violated[s]).rank[truth].min() for s in subsets]
        np.testing.assert_array_equal(ranks, alone)


def test_top_chances_by_hand() -> None:
    """After the first demonstration two hypotheses tie; the second refutes one of them."""
    phi, violated = [[0.5, 0.5, 0.2], [0.0, 0.5, 0.5]], [[False] * 3, [True, False, False]]
    evidence = log_evidence(1 - np.array(phi), violated)
    both = [total_gain(evidence[subsets]) for subsets in ([[0], [1]], [[0, 1]])]
    for good, chances in (
        ([True, False, False], [0.5, 0.0, 0.0]),
        ([True, True, False], [1.0, 0.5, 1.0]),
        ([False, False, True], [0.0, 0.5, 0.0]),
    ):
        found = [top_chances(ranks_of(each), np.array(good), 1) for each in both]
        np.testing.assert_allclose(np.concatenate(found), chances)
    for good, chances in (
        ([True, True, False], [1.0, 0.0, 0.0]),
        ([True, False, True], [0.0, 0.0, 0.0]),
        ([False, True, True], [0.0, 1.0, 1.0]),
    ):
        found = [top_chances(ranks_of(each), np.array(good), 2) for each in both]
        np.testing.assert_allclose(np.concatenate(found), chances)


@pytest.mark.parametrize("top", [1, 2, 3, 5])
def test_top_chances_average_all_ways_to_break_ties(top: int) -> None:
    """Gains are 0, whole numbers of log 2 or infinite, and some hypotheses are violated."""
    rng = np.random.default_rng(2)
    phi = rng.choice([0.0, 0.5, 1.0], (7, 5), p=[0.5, 0.4, 0.1])
    violated = rng.random((7, 5)) < 0.1
    orders = list(itertools.permutations(range(5)))

    def merit(subset: np.ndarray, hypothesis: int) -> tuple[int, Fraction]:
        chances = [Fraction(chance) for chance in phi[subset, hypothesis]]
        if violated[subset, hypothesis].any():
            return -1, Fraction(0)
        if 1 in chances:
            return 1, Fraction(0)
        return 0, Fraction(np.prod([1 / (1 - chance) for chance in chances]))

    seen = []
    for good in (np.array([True, True, True, False, True]), rng.random(5) < 0.6):
        for subsets in random_subsets(7, 4, 6, rng):
            expected = []
            for subset in subsets:
                merits = [merit(subset, i) for i in range(5)]
                ranked = [sorted(order, key=merits.__getitem__, reverse=True) for order in orders]
                expected.append(np.mean([good[best[:top]].all() for best in ranked]))
            gains = total_gain(log_evidence(1 - phi, violated)[subsets])
            found = top_chances(ranks_of(gains), good, top)
            np.testing.assert_allclose(found, expected, atol=1e-12)
            seen += expected
    assert (top == 5) == (max(seen) == 0)
    assert (top == 5) == (len(set(seen)) == 1)


def test_claim_is_the_posterior_of_the_best() -> None:
    """Two hypotheses, of prior 1/4 each beside 1/2 for none; their odds by hand."""
    gains = np.log([[8.0, 1.0], [1.0, 2.0]])
    np.testing.assert_allclose(claims(gains, 0.5), [8 / (8 + 1 + 2), 2 / (1 + 2 + 2)])
    np.testing.assert_allclose(claims(np.array([[-np.inf, 0.0], [np.inf, 0.0]]), 0.5), [1 / 3, 1])
    many = np.random.default_rng(0).normal(0, 3, (50, 7))
    many[many < -4] = -np.inf
    many[:5, :2] = np.inf
    expected = [np.max(posterior(gain, 0.3)[0]) for gain in many]
    np.testing.assert_allclose(claims(many, 0.3), expected, rtol=1e-13)


def test_gains_that_differ_by_rounding_share_the_top() -> None:
    gains = np.array([[1.0, 1.0 + 4e-16, 1.0 - 2e-16, 0.0]])
    good = np.array([True, False, False, False])
    assert len(set(gains[0])) == 4
    assert top_chances(ranks_of(gains), good, 1).tolist() == pytest.approx([1 / 3])
    assert truth_ranks(ranks_of(gains), good).tolist() == [2.0]
