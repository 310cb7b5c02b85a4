"""Four independent routes to the same violation probabilities, on worlds small enough to list."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from toy_models import toy_model

from mlci.demonstrations import Task
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.recursions import reachable_cells
from mlci.regions import Regions
from mlci.spaces import Box, Floats
from mlci.systems import DoubleIntegrator, Pendulum
from mlci.tabular import TabularModel, action_grid, discretize

# Sums of at most 4^5 terms of order 1 in double precision: 1e-12 leaves three digits of room.
TOLERANCE = 1e-12


def toy_world(seed: int) -> TabularModel:
    """Six cells, four moves, three regions; self-loops, moves not allowed, cell 5 out of reach."""
    rng = np.random.default_rng(seed)
    successor = rng.integers(0, 5, size=(6, 4))
    successor[:, 0] = np.arange(6)  # a self-loop everywhere
    successor[:, 3] = successor[:, 2]  # two moves with one successor, to be merged
    allowed = rng.random((6, 4)) < 0.8
    allowed[0, 1] = allowed[0, 2] = True
    successor[1, 1], allowed[1, 1] = -1, False
    crosses = rng.random((6 * 4, 3)) < 0.15
    crosses[3 * 4 : 4 * 4, 2] = True  # cell 3 lies in region 2: every move from it crosses that
    return toy_model(successor, rng.normal(size=(6, 4)), allowed, crosses)


def enumerate_trajectories(
    mdp: TabularModel, start: int, goals: list[int], steps: int
) -> tuple[float, Floats]:
    """Z and, for each region, the part of Z that crosses it, by listing every move sequence."""
    crosses = mdp.kept.crosses.toarray().reshape(mdp.states, mdp.moves, -1)
    total, crossing = 0.0, np.zeros(crosses.shape[2])
    for sequence in itertools.product(range(mdp.moves), repeat=steps):
        state, reward, crossed = start, 0.0, np.zeros(crosses.shape[2], dtype=bool)
        for move in sequence:
            if not mdp.kept.allowed(mdp.truth)[state, move]:
                break
            reward += mdp.kept.reward[state, move]
            crossed |= crosses[state, move]
            state = mdp.kept.successor[state, move]
        else:
            if state in goals:
                total += np.exp(reward)
                crossing += np.exp(reward) * crossed
    return total, crossing


def forward_violation_probabilities(distribution: TrajectoryDistribution) -> Floats:
    """Phi by pushing the mass that has not yet violated forward from the start."""
    mdp = distribution.model
    crosses = mdp.kept.crosses.toarray().reshape(mdp.states, mdp.moves, -1)
    clean = np.zeros((mdp.states, crosses.shape[2]))
    clean[distribution.start] = 1.0
    violated = np.zeros(crosses.shape[2])
    for t in range(distribution.steps):
        after = np.zeros_like(clean)
        for state, chances in zip(*distribution.policy(t), strict=True):
            for move, chance in enumerate(chances):
                moving = chance * clean[state]
                violated += moving * crosses[state, move]
                if chance > 0:
                    after[mdp.kept.successor[state, move]] += moving * ~crosses[state, move]
        clean = after
    return violated


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("goals", [[2], [1, 3, 5]])
def test_four_routes_to_violation_probabilities_agree(seed: int, goals: list[int]) -> None:
    mdp, start, steps = toy_world(seed), 0, 5
    total, crossing = enumerate_trajectories(mdp, start, goals, steps)
    distribution = TrajectoryDistribution(mdp, start, goals, steps)
    assert distribution.is_possible == (total > 0)
    if total == 0:
        assert distribution.log_z[0, start] == -np.inf
        return
    assert distribution.log_z[0, start] == pytest.approx(np.log(total), abs=TOLERANCE)
    expected = crossing / total
    backward = distribution.violation_probabilities()
    np.testing.assert_allclose(backward, expected, rtol=0, atol=TOLERANCE)
    forward = forward_violation_probabilities(distribution)
    np.testing.assert_allclose(forward, expected, rtol=0, atol=TOLERANCE)
    under = [replace(distribution, model=mdp.under(np.arange(3) == i)) for i in range(3)]
    by_partition = [1 - np.exp(each.log_z[0, start] - np.log(total)) for each in under]
    np.testing.assert_allclose(by_partition, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("alpha_bytes", [1, 1 << 15])
def test_regions_block_by_block_have_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, samples: int, alpha_bytes: int
) -> None:
    """One at a time or some: no sum is taken in another order."""
    system = Pendulum()
    grid, actions = Grid(system.space, (11, 12)), action_grid(system, 5)
    regions = Regions.from_grid(system.space, (5, 7))
    mdp = discretize(system, grid, actions, 0.5, regions, samples)
    whole = TrajectoryDistribution(mdp, 12, [90, 91], 10)
    phi = whole.violation_probabilities()
    assert np.sum((phi > 0.01) & (phi < 0.99)) > 10
    monkeypatch.setattr("mlci.recursions.ALPHA_BYTES", alpha_bytes)
    np.testing.assert_array_equal(whole.violation_probabilities(), phi)


@pytest.mark.parametrize("depth", [1.0, 8.0, 60.0])
def test_log_avoidance_is_the_difference_of_log_partitions(depth: float) -> None:
    """To 1e-10 relative down to 1e-30 and below, to 1e-12 absolute elsewhere."""
    deepest = 0.0
    for seed in range(8):
        mdp = toy_world(seed)
        crossing = mdp.kept.crosses.toarray()[:, 0].reshape(6, 4)
        # Moves that cross region 0 are well paid for, so that hardly anything avoids it.
        paid = replace(mdp.kept, reward=mdp.kept.reward + depth * crossing)
        mdp = replace(mdp, kept=paid)
        free = TrajectoryDistribution(mdp, 0, [1, 3], 5)
        if not free.is_possible:
            continue
        alpha = free.avoidance_probabilities()
        for i in range(3):
            under = replace(free, model=mdp.under(np.arange(3) == i))
            if not under.is_possible:
                assert alpha[i] == 0
                continue
            difference = free.log_z[0, 0] - under.log_z[0, 0]
            tolerance = {"rtol": 1e-10, "atol": 0} if alpha[i] < 0.5 else {"rtol": 0, "atol": 1e-12}
            np.testing.assert_allclose(-np.log(alpha[i]), difference, **tolerance)
            deepest = max(deepest, difference)
    assert deepest > depth


def test_what_nothing_avoids_has_probability_zero_exactly() -> None:
    """Two ways to a door that both go through."""
    successor = np.array([[1, 2], [3, 3], [3, 3], [3, 3]])
    crosses = np.zeros((8, 2), dtype=bool)
    crosses[2:6, 0] = True  # the door, from both ways into the last cell
    crosses[0, 1] = True  # the first way
    rewards = np.random.default_rng(0).normal(size=(4, 2))
    mdp = toy_model(successor, rewards, np.ones((4, 2), bool), crosses)
    alpha = TrajectoryDistribution(mdp, 0, 3, 2).avoidance_probabilities()
    one, other = rewards[0] + np.logaddexp(*rewards[1:3].T)
    assert alpha[0] == 0
    assert alpha[1] == pytest.approx(1 / (1 + np.exp(one - other)), rel=1e-12)


def test_the_toy_worlds_are_not_trivial() -> None:
    """The agreement above is worth something only if goals are reached and regions crossed."""
    shares = []
    for seed in range(8):
        total, crossing = enumerate_trajectories(toy_world(seed), 0, [1, 3, 5], 5)
        shares.extend(crossing / total if total else [])
    assert len(shares) >= 15
    assert np.mean([0.01 < share < 0.99 for share in shares]) > 0.5


def test_policy_is_a_distribution_over_allowed_moves_that_stay_on_course() -> None:
    mdp = toy_world(3)
    distribution = TrajectoryDistribution(mdp, 0, [2], 5)
    log_z = distribution.log_z
    for t in range(5):
        cells, chances = distribution.policy(t)
        np.testing.assert_allclose(chances.sum(axis=1), 1.0, atol=1e-15)
        assert np.all(chances[~mdp.kept.allowed(mdp.truth)[cells]] == 0)
        taken = np.argwhere(chances > 0)
        assert np.all(
            np.isfinite(log_z[t + 1, mdp.kept.successor[cells[taken[:, 0]], taken[:, 1]]])
        )


def test_only_cells_between_start_and_goal_carry_probability() -> None:
    """On a one-way corridor each step has one possible cell, and a late goal none."""
    cells = 6
    successor = np.minimum(np.arange(cells) + 1, cells - 1)
    successor[0] = 2  # a way to the goal that does not begin at the start
    corridor = toy_model(
        successor[:, None],
        np.zeros((cells, 1)),
        np.ones((cells, 1), dtype=bool),
        np.zeros((cells, 1), dtype=bool),
    )
    reached = reachable_cells(corridor.merged, [1], 3)
    assert np.argwhere(reached).tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]
    log_z = TrajectoryDistribution(corridor, 1, 4, 3).log_z
    assert np.argwhere(np.isfinite(log_z)).tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]
    assert not TrajectoryDistribution(corridor, 1, 5, 3).is_possible


@pytest.mark.parametrize("goal", [[5], []], ids=["out of reach", "no cell"])
def test_an_unreachable_goal_is_refused_not_nan(goal: list[int]) -> None:
    distribution = TrajectoryDistribution(toy_world(0), 0, goal, 4)
    assert not distribution.is_possible
    assert distribution.log_z[0, 0] == -np.inf
    assert not np.any(np.isnan(distribution.log_z))
    with pytest.raises(ValueError, match="no trajectory from cell 0 reaches a goal: prob"):
        distribution.violation_probabilities()
    with pytest.raises(ValueError, match="no trajectory from cell 0 reaches a goal: nothing"):
        distribution.sample(3, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("start", "goal", "steps", "message"),
    [
        (-1, [1], 3, "start must be a cell from 0 to 5, not -1"),
        (6, [1], 3, "start must be a cell from 0 to 5, not 6"),
        (0, [-1], 3, r"goals must be cells from 0 to 5, not \[-1\]"),
        (0, [1, 6], 3, r"goals must be cells from 0 to 5, not \[1, 6\]"),
        (0, [1], 0, "at least one step, not 0"),
    ],
)
def test_what_is_no_cell_is_refused(start: int, goal: list[int], steps: int, message: str) -> None:
    TrajectoryDistribution(toy_world(0), 5, [0, 5], 1)
    with pytest.raises(ValueError, match=message):
        TrajectoryDistribution(toy_world(0), start, goal, steps)


def test_a_task_is_taken_to_its_cells() -> None:
    system = DoubleIntegrator()
    grid = Grid(system.space, (12, 10))
    model = discretize(
        system, grid, action_grid(system, 3), 0.5, Regions.from_grid(system.space, (2, 2))
    )
    goal = Box([0.2, -np.inf], [0.8, np.inf])
    distribution = TrajectoryDistribution.of_task(model, Task([-1.0, 0.3], goal, 4.0))
    assert distribution.start == grid.index([-1.0, 0.3])
    assert distribution.goal.tolist() == grid.cells_in(goal).tolist()
    assert distribution.steps == 8
    rounded = Task([-1.0, 0.3], goal, 4.0004)
    assert TrajectoryDistribution.of_task(model, rounded).steps == 8
    off = Task([-1.0, 0.3], goal, 4.2)
    with pytest.raises(ValueError, match=r"0.5 s does not divide the horizon of 4.2 s"):
        TrajectoryDistribution.of_task(model, off)
    assert TrajectoryDistribution.of_task(model, off, round_horizon=True).steps == 8
    short = Task([-1.0, 0.3], goal, 0.2)
    assert TrajectoryDistribution.of_task(model, short, round_horizon=True).steps == 1
    with pytest.raises(ValueError, match="lies outside the state space"):
        TrajectoryDistribution.of_task(model, Task([-9.0, 0.0], goal, 4.0))


def test_sampled_trajectories_follow_the_distribution() -> None:
    """Frequencies against Phi, to four standard errors of 20 000 draws."""
    mdp = toy_world(2)
    distribution = TrajectoryDistribution(mdp, 0, [1, 3], 5)
    count = 20_000
    cells, moves = distribution.sample(count, np.random.default_rng(1))
    assert np.all(np.isin(cells[:, -1], [1, 3]))
    np.testing.assert_array_equal(cells[:, 1:], mdp.kept.successor[cells[:, :-1], moves])
    rows = (cells[:, :-1] * mdp.moves + moves).ravel()
    crossed = mdp.kept.crosses.toarray()[rows].reshape(count, 5, -1).any(axis=1)
    phi = distribution.violation_probabilities()
    error = np.sqrt(phi * (1 - phi) / count)
    assert np.all(np.abs(crossed.mean(axis=0) - phi) <= 4 * error + 1e-12)
    first = np.bincount(moves[:, 0], minlength=mdp.moves) / count
    np.testing.assert_allclose(first, distribution.policy(0)[1][0], atol=4 * 0.5 / np.sqrt(count))
