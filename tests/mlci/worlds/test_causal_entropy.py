"""Maximum causal entropy against published values, its equations, and certain moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import logsumexp
from toy_tables import chancy_world, grid_world, random_table

from mlci.worlds.causal_entropy import CausalEntropy
from mlci.worlds.first_exit import FirstExit
from mlci.worlds.tables import Table, TablePath, TableRegion

# From state 0, action 0 leads to the goal 1, or by bad luck to the trap 2, which keeps for ever.
TRAP = np.zeros((3, 2, 3))
TRAP[0, 0, [1, 2]] = 0.5
TRAP[0, 1, 1] = TRAP[2, :, 2] = 1.0


def test_published_values() -> None:
    agent = CausalEntropy(chancy_world(), steps=20)
    expected = [53.29829996, 54.83644321, 54.83644321, 33.64946332, 54.74466167]
    np.testing.assert_allclose(agent.values[0], expected, atol=1e-8)
    np.testing.assert_allclose(agent.policy(0)[1], [0.24843094, 0.0, 0.75156906], atol=1e-8)
    assert np.sum(agent.expected_visits) == pytest.approx(21, abs=1e-10)


def test_visits_follow_the_policy_step_by_step() -> None:
    agent = CausalEntropy(chancy_world(), steps=3, discount=0.7)
    chances = agent.table.transitions.toarray().reshape(5, 3, 5)
    now, visits = agent.table.start, agent.table.start.copy()
    for t in range(3):
        now = np.einsum("s,sa,sap->p", now, agent.policy(t), chances)
        visits = visits + 0.7 ** (t + 1) * now
    np.testing.assert_allclose(agent.expected_visits, visits, rtol=1e-12)


def test_it_maximises_reward_and_causal_entropy() -> None:
    """No policy of two steps, found by a general optimiser, has more of both."""
    table = chancy_world()
    chances = table.transitions.toarray().reshape(5, 3, 5)

    def loss(numbers: np.ndarray) -> float:
        policies = np.exp(numbers.reshape(2, 5, 3))
        policies /= policies.sum(axis=2, keepdims=True)
        now, total = table.start, 0.0
        for policy in policies:
            total += np.sum(now[:, None] * policy * (table.reward - np.log(policy)))
            now = np.einsum("s,sa,sap->p", now, policy, chances)
        return -total

    best = minimize(loss, np.zeros(30), method="SLSQP", jac="3-point", options={"ftol": 1e-14})
    agent = CausalEntropy(table, steps=2)
    assert -best.fun == pytest.approx(table.start @ agent.values[0], abs=1e-8)


def test_without_a_horizon_one_more_step_changes_nothing() -> None:
    table = chancy_world()
    agent = CausalEntropy(table, discount=0.95)
    chances = table.transitions.toarray().reshape(5, 3, 5)
    values = agent.values[0]
    again = logsumexp(table.reward + 0.95 * chances @ values, axis=1)
    np.testing.assert_allclose(again, values, rtol=1e-12)
    long = CausalEntropy(table, steps=700, discount=0.95)
    np.testing.assert_allclose(long.values[0], values, rtol=1e-12)
    np.testing.assert_allclose(long.expected_visits, agent.expected_visits, rtol=1e-12)
    assert np.sum(agent.expected_visits) == pytest.approx(1 / (1 - 0.95))


@pytest.mark.parametrize("seed", range(5))
def test_with_certain_moves_it_is_first_exit(seed: int) -> None:
    table = random_table(np.random.default_rng(seed), states=7, actions=3)
    trajectories, agent = FirstExit(table), CausalEntropy(table)
    there = np.isfinite(trajectories.log_z)
    np.testing.assert_allclose(agent.values[0][there], trajectories.log_z[there], rtol=1e-12)
    np.testing.assert_allclose(agent.policy()[there], trajectories.policy[there], atol=1e-12)
    np.testing.assert_allclose(agent.expected_visits, trajectories.expected_visits, atol=1e-12)


def test_in_a_world_of_chance_it_is_not_the_trajectories() -> None:
    """Action 0 wins 10 nat or loses 10, evenly; action 1 brings 2. The trajectories' distribution
    would count on its luck, and take action 0 nearly always."""
    chances = np.zeros((4, 2, 4))
    chances[0, 0, [1, 2]], chances[0, 1, 3] = 0.5, 1.0
    chances[1:, :, 3] = 1.0
    reward = np.array([[0.0, 2.0], [10.0, 10.0], [-10.0, -10.0], [0.0, 0.0]])
    agent = CausalEntropy(Table.from_arrays(chances, reward, 0), steps=2)
    causal = agent.policy(0)[0]
    assert causal[0] / causal[1] == pytest.approx(np.exp(0 - 2))
    assert 0.5 * np.exp(10) / np.exp(2) > 1000


def test_constraints_forbid_what_may_lead_into_a_state() -> None:
    table = chancy_world()
    named = {"3": TableRegion(states=[3])}
    table = Table.from_arrays(table.transitions, table.reward, table.start, regions=named)
    agent = CausalEntropy(table.under([True]), steps=20)
    np.testing.assert_allclose(agent.policy(0)[1], [0, 0, 1], atol=1e-12)
    assert agent.values[0, 3] == -np.inf
    assert agent.expected_visits[3] == 0


def test_a_dead_end_that_chance_may_bring_is_avoided() -> None:
    """Where it cannot be, no policy lasts."""
    dead = TRAP.copy()
    dead[2] = 0.0
    table = Table.from_arrays(dead, -1.0, 0, 1)
    for steps in (None, 3):
        agent = CausalEntropy(table, steps=steps)
        np.testing.assert_allclose(agent.policy(0)[0], [0, 1], atol=1e-12)
        np.testing.assert_allclose(agent.expected_visits, [1, 1, 0], atol=1e-12)
    dead[0, 1] = dead[0, 0]
    hopeless = Table.from_arrays(dead, -1.0, 0, 1)
    for steps in (None, 3):
        with pytest.raises(ValueError, match=r"no policy from \[0\] always has a move"):
            _ = CausalEntropy(hopeless, steps=steps).expected_visits


def test_for_ever_needs_goals_or_a_discount() -> None:
    table = Table.from_arrays(TRAP, -1.0, 0, 1)
    with pytest.raises(ValueError, match="no goal can be reached from state 2, which the start"):
        _ = CausalEntropy(table).values
    assert CausalEntropy(table, discount=0.5).values[0, 2] == pytest.approx(
        (np.log(2) - 1) / (1 - 0.5)
    )


def test_values_that_grow_without_end_are_refused() -> None:
    with pytest.raises(ValueError, match="values grow without end"):
        _ = CausalEntropy(grid_world(5, goal=24, reward=-1.0)).values


def test_probability_of_a_path_is_that_of_its_actions() -> None:
    agent = CausalEntropy(chancy_world(), steps=2)
    path = TablePath(np.array([0, 2, 4]), np.array([0, 2]))
    expected = np.log(agent.policy(0)[0, 0]) + np.log(agent.policy(1)[2, 2])
    assert agent.log_probability(path) == pytest.approx(expected)
    with pytest.raises(ValueError, match="a path has 1 actions, the horizon 2"):
        agent.log_probability(TablePath(np.array([0, 2]), np.array([0])))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"steps": 0}, "a horizon needs a whole number of steps, at least one, not 0"),
        ({"discount": 0.0}, r"a discount must lie in \(0, 1\], not 0.0"),
        ({"discount": 1.1}, r"a discount must lie in \(0, 1\], not 1.1"),
    ],
)
def test_what_is_no_horizon_or_discount_is_refused(arguments: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        CausalEntropy(chancy_world(), **arguments)
