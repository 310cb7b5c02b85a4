"""First exit against published values, sums over all trajectories, and fixed horizons."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from toy_tables import chancy_world, grid_world, published_grid, random_table

from mlci.worlds.first_exit import FirstExit
from mlci.worlds.tables import Table

# log Z of Scobee and Sastry's grid, as their code gives it, with one constraint after the other.
PUBLISHED = {
    None: -25.937183169,
    "action 5": -31.376292202,
    "green": -39.293690895,
    "state 31": -43.944475880,
    "state 39": -48.338109673,
    "state 47": -53.275873579,
    "action 4": -53.516090129,
}


def weights(table: Table) -> np.ndarray:
    """(S, S) sum of e^reward over the moves from one state to another."""
    weight = np.zeros((table.states, table.states))
    for state, action in np.argwhere(table.allowed):
        weight[state, table.successor[state, action]] += np.exp(table.reward[state, action])
    return weight


def test_published_values() -> None:
    table = published_grid()
    for name, log_z in PUBLISHED.items():
        if name is not None:
            table = table.under(table.mask([name]))
        assert FirstExit(table).log_z[0] == pytest.approx(log_z, abs=1e-8)


def test_it_is_the_sum_over_all_trajectories() -> None:
    """Every sequence of up to 9 actions written out; what is longer weighs less than 1e-7."""
    rng = np.random.default_rng(0)
    table = random_table(rng, states=4, actions=2, cost=6.0)
    total, longest = 0.0, 9
    for length in range(1, longest + 1):
        for actions in product(range(2), repeat=length):
            state, reward = 0, 0.0
            for k, action in enumerate(actions):
                if not table.allowed[state, action]:
                    break
                reward += table.reward[state, action]
                state = table.successor[state, action]
                if state == 3:
                    total += np.exp(reward) * (k + 1 == length)
                    break
    assert total > 0
    assert FirstExit(table).log_z[0] == pytest.approx(np.log(total), abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_fixed_horizons_add_up_to_it(seed: int) -> None:
    """The sum over horizons of the trajectories that first meet the goal at their last step."""
    table = random_table(np.random.default_rng(seed), states=8, actions=3)
    weight, after = weights(table), np.eye(8)[7]
    total = after.copy()
    for _ in range(400):
        after = weight @ after
        total += after
    log_z = FirstExit(table).log_z
    there = np.isfinite(log_z)
    np.testing.assert_allclose(log_z[there], np.log(total[there]), rtol=1e-12)


def test_values_that_lie_far_apart_keep_their_digits() -> None:
    """On a line of 400 states Z falls to e^-2000; each state has 10 moves ahead or none back."""
    states = 400
    ahead = np.minimum(np.arange(1, states + 1), states - 1)[:, None].repeat(10, axis=1)
    log_z = FirstExit(Table.from_arrays(ahead, -5.0, 0, states - 1)).log_z
    steps = np.arange(states - 1, -1, -1)
    np.testing.assert_allclose(log_z, steps * (np.log(10) - 5), rtol=1e-13)


def test_a_wide_grid_agrees_with_long_horizons() -> None:
    """Many best trajectories: numbers from 1 to 1e16 in one system."""
    table = grid_world(30, goal=899, reward=-3.0)
    weight, log_weight = weights(table), np.full(900, -np.inf)
    log_weight[899] = 0.0
    total = log_weight
    for _ in range(1200):
        with np.errstate(divide="ignore"):
            shift = np.max(log_weight)
            log_weight = np.log(weight @ np.exp(log_weight - shift)) + shift
        total = np.logaddexp(total, log_weight)
    np.testing.assert_allclose(FirstExit(table).log_z, total, rtol=1e-10)


def test_near_divergence_every_number_keeps_its_digits() -> None:
    """The backup must hold in every state, also where other states have e^26 times as much."""
    distribution = FirstExit(grid_world(60, goal=3599, reward=-2.1))
    rows = np.sum(distribution.policy[:3599], axis=1)
    np.testing.assert_allclose(rows, 1.0, rtol=1e-11)


@pytest.mark.parametrize("seed", range(40))
def test_it_diverges_exactly_where_the_spectral_radius_is_1_or_more(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table = random_table(rng, states=6, actions=3, cost=rng.uniform(0.2, 1.5))
    weight = weights(table)
    ahead = np.linalg.matrix_power(np.eye(6) + (weight > 0), 6) > 0
    on_way = np.flatnonzero(ahead[0] & ahead[:, 5])
    radius = np.max(np.abs(np.linalg.eigvals(weight[np.ix_(on_way, on_way)])), initial=0.0)
    if radius < 1:
        assert np.all(np.isfinite(FirstExit(table).log_z[on_way]))
    else:
        with pytest.raises(ValueError, match="the sum over trajectories diverges"):
            _ = FirstExit(table).log_z


def test_the_message_names_the_factor() -> None:
    """Two moves that stay at reward log(0.6): each step, what stays gains 1.2."""
    table = Table.from_arrays([[0, 0, 1], [0, 0, 0]], np.log(0.6), 0, 1)
    with pytest.raises(ValueError, match=r"by a factor of 1\.2\. Make moves cost more"):
        _ = FirstExit(table).log_z


def test_what_cannot_be_reached_does_not_make_it_diverge() -> None:
    """State 2, which the start does not lead to, goes round for nothing."""
    table = Table.from_arrays([[1, -1], [-1, -1], [2, 1]], [[-1.0], [0.0], [3.0]], 0, 1)
    assert FirstExit(table).log_z.tolist() == [-1.0, 0.0, -np.inf]


def test_policy_and_visits_are_those_of_the_trajectories() -> None:
    table = random_table(np.random.default_rng(2), states=6, actions=3)
    distribution = FirstExit(table)
    policy, log_z = distribution.policy, distribution.log_z
    on_way = np.isfinite(log_z) & (np.arange(6) != 5)
    np.testing.assert_allclose(policy.sum(axis=1), on_way, atol=1e-12)
    # Visits of a state: the weight of ways to it, of no length too, times that of ways from it.
    ways = np.linalg.inv(np.eye(6) - weights(table))
    expected = ways[0] * np.exp(log_z) / np.exp(log_z[0])
    np.testing.assert_allclose(distribution.expected_visits, expected, atol=1e-12)


def test_a_goal_that_cannot_be_reached_is_minus_infinity() -> None:
    table = Table.from_arrays([[0], [1]], -1.0, 0, 1)
    assert FirstExit(table).log_z.tolist() == [-np.inf, 0.0]
    with pytest.raises(ValueError, match=r"no goal can be reached from \[0\]"):
        _ = FirstExit(table).expected_visits


def test_a_circle_of_positive_reward_diverges() -> None:
    table = Table.from_arrays([[0, 1], [0, 0]], 0.5, 0, 1)
    with pytest.raises(ValueError, match="some circle of moves has a positive reward"):
        _ = FirstExit(table).log_z


def test_chance_is_refused() -> None:
    with pytest.raises(ValueError, match=r"are for mlci\.worlds\.causal_entropy"):
        _ = FirstExit(chancy_world()).log_z
