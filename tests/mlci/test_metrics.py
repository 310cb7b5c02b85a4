"""The study's measures by hand, and what the tabular model's own samples must give."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest

from mlci.grids import Grid
from mlci.inference import rank_constraints
from mlci.metrics import (
    Diagnosis,
    diagnose,
    final_state_error,
    random_subsets,
    top_chances,
    truth_ranks,
    violation_distance,
)
from mlci.regions import ConstraintSet
from mlci.spaces import Box
from mlci.systems import DoubleIntegrator, Pendulum
from mlci.tabular import action_grid, discretize


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


def test_random_subsets_are_nested_and_distinct() -> None:
    subsets = random_subsets(8, 20, 5, np.random.default_rng(0))
    assert [part.shape for part in subsets] == [(5, size) for size in range(1, 9)]
    for smaller, larger in itertools.pairwise(subsets):
        np.testing.assert_array_equal(larger[:, :-1], smaller)
    assert all(len(set(row)) == 8 for row in subsets[-1].tolist())


def test_a_truth_that_covers_no_hypothesis_has_no_rank() -> None:
    ranks = truth_ranks([[0.2, 0.1]], [[False, True]], np.array([False, False]), np.array([[0]]))
    assert np.isnan(ranks).tolist() == [True]


def test_truth_ranks_equal_ranking_each_subset_alone() -> None:
    rng = np.random.default_rng(1)
    phi = rng.random((12, 7)) * (rng.random((12, 7)) < 0.5)
    violated = rng.random((12, 7)) < 0.05
    truth = np.array([False, True, False, False, True, False, False])
    for subsets in random_subsets(12, 6, 9, rng):
        ranks = truth_ranks(phi, violated, truth, subsets)
        alone = [rank_constraints(phi[s], violated[s]).rank[truth].min() for s in subsets]
        np.testing.assert_array_equal(ranks, alone)


def test_top_chances_by_hand() -> None:
    """After the first demonstration two hypotheses tie; the second refutes one of them."""
    phi, violated = [[0.5, 0.5, 0.2], [0.0, 0.5, 0.5]], [[False] * 3, [True, False, False]]
    both = np.array([[0], [1]]), np.array([[0, 1]])
    for good, chances in (
        ([True, False, False], [0.5, 0.0, 0.0]),
        ([True, True, False], [1.0, 0.5, 1.0]),
        ([False, False, True], [0.0, 0.5, 0.0]),
    ):
        found = [top_chances(phi, violated, np.array(good), each, 1) for each in both]
        np.testing.assert_allclose(np.concatenate(found), chances)
    for good, chances in (
        ([True, True, False], [1.0, 0.0, 0.0]),
        ([True, False, True], [0.0, 0.0, 0.0]),
        ([False, True, True], [0.0, 1.0, 1.0]),
    ):
        found = [top_chances(phi, violated, np.array(good), each, 2) for each in both]
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
            found = top_chances(phi, violated, good, subsets, top)
            np.testing.assert_allclose(found, expected, atol=1e-12)
            seen += expected
    assert (top == 5) == (max(seen) == 0)
    assert (top == 5) == (len(set(seen)) == 1)


@pytest.mark.parametrize(
    ("cells", "dt", "frozen"),
    [(10, 0.1, True), (10, 0.2, True), (20, 0.1, True), (20, 0.25, False), (10, 0.5, False)],
)
def test_diagnosis_tells_a_grid_that_cannot_change_speed(
    cells: int, dt: float, frozen: bool
) -> None:
    """From a cell's middle, |u + sin| dt must exceed half a cell: 3 dt > 6 / cells, or nothing."""
    system = Pendulum()
    grid, actions = Grid(system.space, (cells, cells)), action_grid(system, 9)
    mdp = discretize(system, grid, actions, dt, ConstraintSet.from_grid(system.space, (2, 2)))
    diagnosis = diagnose(system, grid, actions, dt, mdp)
    assert (diagnosis.frozen[1] > 0.9) == frozen


@pytest.mark.parametrize("at_once", [7, 1 << 17])
def test_diagnosis_counts_what_moves_do(monkeypatch: pytest.MonkeyPatch, at_once: int) -> None:
    """Move by move, on a grid where many moves leave the bounds."""
    system = DoubleIntegrator()
    grid, actions = Grid(system.space, (5, 6)), action_grid(system, 3)
    mdp = discretize(system, grid, actions, 0.9, ConstraintSet.from_grid(system.space, (2, 2)))
    monkeypatch.setattr("mlci.tabular._MOVES_AT_ONCE", at_once)
    diagnosis = diagnose(system, grid, actions, 0.9, mdp)
    stay, leave, changing = 0, 0, [set(), set()]
    for cell in range(grid.size):
        for move in range(3):
            end = int(mdp.successor[cell, move])
            stay += end == cell
            leave += end < 0
            for d in range(2):
                if (
                    end >= 0
                    and np.unravel_index(end, (5, 6))[d] != np.unravel_index(cell, (5, 6))[d]
                ):
                    changing[d].add(cell)
    assert leave > 0
    assert diagnosis.leave == pytest.approx(leave / 90)
    assert diagnosis.stay == pytest.approx(stay / (90 - leave))
    assert diagnosis.frozen == pytest.approx([1 - len(cells) / 30 for cells in changing])
    speed = np.abs(grid.centers[:, 1])[:, None] * 0.9 / grid.widths[0]
    push = np.abs(actions[:, 0]) * 0.9 / grid.widths[1]
    assert diagnosis.cells_crossed == pytest.approx(np.mean(np.maximum(speed, push)))


def test_concerns_name_the_trouble_and_the_remedy() -> None:
    names = ("angle", "angular_velocity")
    assert Diagnosis(0.1, 0.0, 2.0, (0.1, 0.0)).concerns(names, 0, 20) == []
    frozen = Diagnosis(0.6, 0.0, 0.5, (0.2, 1.0)).concerns(names, 18, 22)
    assert "100% of the cells no action changes the angular velocity cell" in frozen[0]
    assert "18 of 22 goals cannot be reached" in frozen[1]
    assert "a longer time step, more cells" in frozen[2]
    lost = Diagnosis(0.0, 0.0, 19.0, (0.0, 0.0)).concerns(names, 13, 65)
    assert "13 of 65 goals cannot be reached" in lost[0]
    assert "more actions, a shorter step, or start points averaged" in lost[1]
    leaving = Diagnosis(0.0, 0.8, 9.0, (0.0, 0.0)).concerns(names, 0, 20)
    assert len(leaving) == 1
    assert "widen its bounds" in leaving[0]
