"""The soft agent against the project's other distributions, and against its own samples."""

from __future__ import annotations

import numpy as np
import pytest
from toy_tables import chancy_world, random_table

from mlci.rivals.agent import Agent
from mlci.worlds.causal_entropy import CausalEntropy
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.tables import Table, TableRegion


def certain_agent() -> Agent:
    """An agent in a random world of certain moves."""
    table = random_table(np.random.default_rng(3), states=9, actions=4, regions=3)
    return Agent(table, 6, final=table.goals)


def test_where_moves_are_certain_it_is_the_distribution_of_a_fixed_horizon() -> None:
    agent = certain_agent()
    world = FixedHorizon(agent.table, agent.steps)
    for t in range(agent.steps):
        policy = world.policy(t)
        there = policy.any(axis=1)  # the states that it may have come to
        assert there.any()
        np.testing.assert_allclose(agent.policy[t, there], policy[there], atol=1e-12)
    np.testing.assert_allclose(agent.expected_visits, world.expected_visits, atol=1e-12)


def test_it_keeps_out_of_a_region_as_often_as_the_partition_functions_say() -> None:
    agent = certain_agent()
    for i in range(3):
        moves = np.asarray(agent.table.crosses[:, i].toarray()).ravel() > 0
        mask = np.arange(3) == i
        log_z = [FixedHorizon(w.table, agent.steps).log_z[0, 0] for w in (agent, agent.under(mask))]
        assert agent.keeps_out(moves) == pytest.approx(np.exp(log_z[1] - log_z[0]), abs=1e-12)


def test_where_chance_decides_it_is_the_policy_of_maximum_causal_entropy() -> None:
    agent = Agent(chancy_world(), 5, discount=0.8)
    world = CausalEntropy(agent.table, 5, 0.8)
    for t in range(agent.steps):
        np.testing.assert_allclose(agent.policy[t], world.policy(t), atol=1e-12)
    whole = Agent(chancy_world(), 5)
    visits = CausalEntropy(whole.table, 5).expected_visits
    np.testing.assert_allclose(whole.expected_visits, visits, atol=1e-12)


def test_a_path_ends_where_chance_leaves_no_way_on() -> None:
    chances = np.zeros((3, 1, 3))
    chances[0, 0, [1, 2]] = 0.75, 0.25  # nothing goes on from 1, and 2 is the goal
    table = Table.from_arrays(chances, 1.0, start=0, goals=2)
    agent = Agent(table, 4)
    assert agent.is_possible
    assert agent.expected_visits.tolist() == [1, 0.75, 0.25]


def test_samples_come_as_often_as_expected_and_expect_the_discounted_reward() -> None:
    agent = Agent(chancy_world(), 3, discount=0.5)
    paths = agent.sample(500, np.random.default_rng(0))
    visits = np.bincount(np.concatenate([path.states for path in paths]), minlength=5) / 500
    np.testing.assert_allclose(visits, agent.expected_visits, atol=5 * np.sqrt(3 / 500))
    reward = [
        sum(
            0.5**t * agent.table.reward[s, a]
            for t, (s, a) in enumerate(zip(p.states[:-1], p.actions, strict=True))
        )
        for p in paths
    ]
    error = np.std(reward) / np.sqrt(500)
    assert agent.expected_reward == pytest.approx(np.mean(reward), abs=4 * error)


def test_penalties_make_moves_of_a_region_rarer_and_at_last_none() -> None:
    agent = certain_agent()
    inside = agent.table.crosses[:, 1]
    often = [
        float((inside.T @ agent.with_penalties(np.array([0, price, 0])).flows)[0])
        for price in (0.0, 2.0, 200.0)
    ]
    assert often[0] > often[1] > often[2]
    assert often[2] == pytest.approx(0, abs=1e-12)


def test_no_way_is_told() -> None:
    table = Table.from_arrays(np.array([[1], [-1]]), -1.0, 0, 1, {"all": TableRegion(states=[1])})
    agent = Agent(table, 2, final=table.goals).under(np.array([True]))
    assert not agent.is_possible
    with pytest.raises(ValueError, match="no way from its start"):
        agent.sample(1, np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"a discount in \(0, 1\], not 0"):
        Agent(table, 2, discount=0)
