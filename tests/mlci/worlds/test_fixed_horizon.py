"""Trajectories of a fixed number of moves against lists of all, and against first exit."""

from __future__ import annotations

import numpy as np
import pytest
from toy_tables import published_grid, random_table, trajectories

from mlci.worlds.causal_entropy import CausalEntropy
from mlci.worlds.first_exit import FirstExit
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.tables import Table


@pytest.mark.parametrize("seed", [0, 1, 2, 5])
@pytest.mark.parametrize("goals", [[4], []])
def test_it_is_the_list_of_all_trajectories(seed: int, goals: list[int]) -> None:
    some = random_table(np.random.default_rng(seed), states=5, actions=3, regions=4, cost=1.0)
    table = Table.from_arrays(some.successor, some.reward, 0, goals, some.regions)
    everything = trajectories(table, steps=5)
    distribution = FixedHorizon(table, steps=5)
    total = sum(weight for weight, _, _ in everything)
    assert distribution.log_z[0, 0] == pytest.approx(np.log(total), rel=1e-12)
    crosses = table.crosses.toarray()
    alpha, visits = np.zeros(4), np.zeros(5)
    for weight, states, rows in everything:
        alpha += weight / total * ~crosses[rows].any(axis=0)
        np.add.at(visits, states, weight / total)
    np.testing.assert_allclose(distribution.avoidance_probabilities(0), alpha, atol=1e-12)
    np.testing.assert_allclose(distribution.expected_visits, visits, atol=1e-12)


def test_long_enough_it_is_first_exit() -> None:
    table = published_grid()
    long, whole = FixedHorizon(table, steps=60), FirstExit(table)
    np.testing.assert_allclose(
        long.log_z[0], np.where(long.log_z[0] > -np.inf, whole.log_z, -np.inf)
    )
    assert long.log_z[0, 0] == pytest.approx(whole.log_z[0], abs=1e-9)
    np.testing.assert_allclose(long.policy(0)[0], whole.policy[0], atol=1e-10)
    np.testing.assert_allclose(long.expected_visits, whole.expected_visits, atol=1e-8)
    alpha = long.avoidance_probabilities(0)
    for name in ("action 5", "green", "state 31"):
        mask = table.mask([name])
        expected = np.exp(FirstExit(table.under(mask)).log_z[0] - whole.log_z[0])
        assert alpha[mask][0] == pytest.approx(expected, rel=1e-8)


def test_without_goals_it_is_the_causal_policy_of_certain_moves() -> None:
    some = random_table(np.random.default_rng(3), states=6, actions=3)
    successor = np.where(some.successor < 0, 0, some.successor)
    table = Table.from_arrays(successor, some.reward, np.full(6, 1 / 6))
    fixed, agent = FixedHorizon(table, steps=8), CausalEntropy(table, steps=8)
    np.testing.assert_allclose(fixed.log_z[:-1], agent.values, rtol=1e-12)
    np.testing.assert_allclose(fixed.policy(3), agent.policy(3), atol=1e-12)
    np.testing.assert_allclose(fixed.expected_visits, agent.expected_visits, atol=1e-12)


def test_what_has_no_trajectory_is_refused() -> None:
    table = Table.from_arrays([[1], [2], [2]], -1.0, 0, 2)
    short = FixedHorizon(table, steps=1)
    assert short.log_z[0, 0] == -np.inf
    with pytest.raises(ValueError, match=r"no trajectory from \[0\] ends in a goal"):
        short.avoidance_probabilities(0)
    with pytest.raises(ValueError, match=r"no trajectory from \[0\] ends in a goal"):
        _ = short.expected_visits
