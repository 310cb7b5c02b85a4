"""Four independent routes to the same violation probabilities, on worlds small enough to list."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy import sparse

from mlci.grids import Grid
from mlci.maxent import (
    expected_violations,
    log_partition,
    policy,
    reachable,
    sample_moves,
    violation_probabilities,
)
from mlci.regions import ConstraintSet
from mlci.spaces import Floats
from mlci.systems import Pendulum
from mlci.tabular import TabularMDP, action_grid, discretize, forbid

# Sums of at most 4^5 terms of order 1 in double precision: 1e-12 leaves three digits of room.
TOLERANCE = 1e-12


def toy_mdp(seed: int) -> TabularMDP:
    """Six cells, four moves, three regions; self-loops, moves not allowed, cell 5 out of reach."""
    rng = np.random.default_rng(seed)
    successor = rng.integers(0, 5, size=(6, 4))
    successor[:, 0] = np.arange(6)  # a self-loop everywhere
    successor[:, 3] = successor[:, 2]  # two moves with one successor, to be merged
    allowed = rng.random((6, 4)) < 0.8
    allowed[0, 1] = allowed[0, 2] = True
    successor[1, 1], allowed[1, 1] = -1, False
    crosses = rng.random((6 * 4, 3)) < 0.15
    return TabularMDP(
        successor=successor,
        reward=rng.normal(size=(6, 4)),
        allowed=allowed,
        crosses=sparse.csr_matrix(crosses),
        action=np.arange(4),
    )


def enumerate_trajectories(
    mdp: TabularMDP, start: int, goals: list[int], steps: int
) -> tuple[float, Floats]:
    """Z and, for each region, the part of Z that crosses it, by listing every move sequence."""
    crosses = mdp.crosses.toarray().reshape(mdp.states, mdp.moves, -1)
    total, crossing = 0.0, np.zeros(crosses.shape[2])
    for sequence in itertools.product(range(mdp.moves), repeat=steps):
        state, reward, crossed = start, 0.0, np.zeros(crosses.shape[2], dtype=bool)
        for move in sequence:
            if not mdp.allowed[state, move]:
                break
            reward += mdp.reward[state, move]
            crossed |= crosses[state, move]
            state = mdp.successor[state, move]
        else:
            if state in goals:
                total += np.exp(reward)
                crossing += np.exp(reward) * crossed
    return total, crossing


def forward_violation_probabilities(mdp: TabularMDP, log_z: Floats, start: int) -> Floats:
    """Phi by pushing the mass that has not yet violated forward from the start."""
    crosses = mdp.crosses.toarray().reshape(mdp.states, mdp.moves, -1)
    clean = np.zeros((mdp.states, crosses.shape[2]))
    clean[start] = 1.0
    violated = np.zeros(crosses.shape[2])
    for t in range(len(log_z) - 1):
        after = np.zeros_like(clean)
        for state, chances in zip(*policy(mdp, log_z, t), strict=True):
            for move, chance in enumerate(chances):
                moving = chance * clean[state]
                violated += moving * crosses[state, move]
                if chance > 0:
                    after[mdp.successor[state, move]] += moving * ~crosses[state, move]
        clean = after
    return violated


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("goals", [[2], [1, 3, 5]])
def test_four_routes_to_violation_probabilities_agree(seed: int, goals: list[int]) -> None:
    mdp, start, steps = toy_mdp(seed), 0, 5
    total, crossing = enumerate_trajectories(mdp, start, goals, steps)
    log_z = log_partition(mdp, start, goals, steps)
    if total == 0:
        assert log_z[0, start] == -np.inf
        return
    assert log_z[0, start] == pytest.approx(np.log(total), abs=TOLERANCE)
    expected = crossing / total
    backward = violation_probabilities(mdp, log_z, start)
    np.testing.assert_allclose(backward, expected, rtol=0, atol=TOLERANCE)
    forward = forward_violation_probabilities(mdp, log_z, start)
    np.testing.assert_allclose(forward, expected, rtol=0, atol=TOLERANCE)
    by_partition = [
        1 - np.exp(log_partition(forbid(mdp, i), start, goals, steps)[0, start] - np.log(total))
        for i in range(3)
    ]
    np.testing.assert_allclose(by_partition, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize(("cells_at_once", "phi_bytes"), [(1, 1), (7, 1 << 15), (1 << 12, 1)])
def test_blocks_of_any_size_give_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, samples: int, cells_at_once: int, phi_bytes: int
) -> None:
    """A cell and a region at a time, some of each, or all: no sum is taken in another order."""
    system = Pendulum()
    grid, actions = Grid(system.space, (11, 12)), action_grid(system, 5)
    regions = ConstraintSet.from_grid(system.space, (5, 7))
    mdp = discretize(system, grid, actions, 0.5, regions, samples)
    whole = log_partition(mdp, 40, [90, 91], 10)
    phi = violation_probabilities(mdp, whole, 40)
    assert np.sum((phi > 0.01) & (phi < 0.99)) > 10
    monkeypatch.setattr("mlci.maxent._CELLS_AT_ONCE", cells_at_once)
    monkeypatch.setattr("mlci.maxent.PHI_BYTES", phi_bytes)
    log_z = log_partition(mdp, 40, [90, 91], 10)
    np.testing.assert_array_equal(log_z, whole)
    np.testing.assert_array_equal(violation_probabilities(mdp, log_z, 40), phi)


def test_the_toy_worlds_are_not_trivial() -> None:
    """The agreement above is worth something only if goals are reached and regions crossed."""
    shares = []
    for seed in range(8):
        total, crossing = enumerate_trajectories(toy_mdp(seed), 0, [1, 3, 5], 5)
        shares.extend(crossing / total if total else [])
    assert len(shares) >= 15
    assert np.mean([0.01 < share < 0.99 for share in shares]) > 0.5


def test_policy_is_a_distribution_over_allowed_moves_that_stay_on_course() -> None:
    mdp = toy_mdp(3)
    log_z = log_partition(mdp, 0, [2], 5)
    for t in range(5):
        cells, chances = policy(mdp, log_z, t)
        np.testing.assert_allclose(chances.sum(axis=1), 1.0, atol=1e-15)
        assert np.all(chances[~mdp.allowed[cells]] == 0)
        taken = np.argwhere(chances > 0)
        assert np.all(np.isfinite(log_z[t + 1, mdp.successor[cells[taken[:, 0]], taken[:, 1]]]))


def test_only_cells_between_start_and_goal_carry_probability() -> None:
    """On a one-way corridor each step has one possible cell, and a late goal none."""
    cells = 6
    mdp = TabularMDP(
        successor=np.minimum(np.arange(cells) + 1, cells - 1)[:, None],
        reward=np.zeros((cells, 1)),
        allowed=np.ones((cells, 1), dtype=bool),
        crosses=sparse.csr_matrix((cells, 1), dtype=bool),
        action=np.zeros(1, dtype=np.int64),
    )
    assert [part.tolist() for part in reachable(mdp, 1, 3)] == [[1], [2], [3], [4]]
    log_z = log_partition(mdp, 1, 4, 3)
    assert np.argwhere(np.isfinite(log_z)).tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]
    assert log_partition(mdp, 1, 5, 3)[0, 1] == -np.inf


def test_an_unreachable_goal_is_refused_not_nan() -> None:
    mdp = toy_mdp(0)
    log_z = log_partition(mdp, 0, [5], 4)
    assert log_z[0, 0] == -np.inf
    assert not np.any(np.isnan(log_z))
    with pytest.raises(ValueError, match="no trajectory from cell 0 reaches a goal"):
        violation_probabilities(mdp, log_z, 0)
    with pytest.raises(ValueError, match="no trajectory from cell 0 reaches a goal"):
        sample_moves(mdp, log_z, 0, 3, np.random.default_rng(0))


def test_a_start_outside_the_grid_is_refused() -> None:
    with pytest.raises(ValueError, match="a cell from 0 to 5, not -1"):
        log_partition(toy_mdp(0), -1, [1], 3)


def test_sampled_trajectories_follow_the_distribution() -> None:
    """Frequencies against Phi, to four standard errors of 20 000 draws."""
    mdp = toy_mdp(2)
    log_z = log_partition(mdp, 0, [1, 3], 5)
    count = 20_000
    cells, moves = sample_moves(mdp, log_z, 0, count, np.random.default_rng(1))
    assert np.all(np.isin(cells[:, -1], [1, 3]))
    np.testing.assert_array_equal(cells[:, 1:], mdp.successor[cells[:, :-1], moves])
    rows = (cells[:, :-1] * mdp.moves + moves).ravel()
    crossed = mdp.crosses.toarray()[rows].reshape(count, 5, -1).any(axis=1)
    phi = violation_probabilities(mdp, log_z, 0)
    error = np.sqrt(phi * (1 - phi) / count)
    assert np.all(np.abs(crossed.mean(axis=0) - phi) <= 4 * error + 1e-12)
    first = np.bincount(moves[:, 0], minlength=mdp.moves) / count
    np.testing.assert_allclose(first, policy(mdp, log_z, 0)[1][0], atol=4 * 0.5 / np.sqrt(count))


def test_several_tasks_are_each_alone() -> None:
    """One that cannot be done has zeros, and progress is told after each."""
    mdp = toy_mdp(0)
    told: list[tuple[int, int]] = []
    goals = [[2], [5], [1, 3]]
    phi, reached = expected_violations(
        mdp, [0, 0, 1], goals, [5, 4, 3], progress=lambda *count: told.append(count)
    )
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert reached.tolist() == [True, False, True]
    assert not phi[1].any()
    for j, (start, steps) in {0: (0, 5), 2: (1, 3)}.items():
        total, crossing = enumerate_trajectories(mdp, start, goals[j], steps)
        np.testing.assert_allclose(phi[j], crossing / total, rtol=0, atol=TOLERANCE)
