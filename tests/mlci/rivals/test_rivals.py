"""Gains of sets and the other methods, in small worlds, against sums and other code."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from toy_tables import chancy_world

from mlci.evidence import Rates
from mlci.rivals.agent import Agent
from mlci.rivals.penalty_map import penalty_map
from mlci.rivals.printed import certain, printed_avoidance
from mlci.rivals.problem import Problem, Shown
from mlci.rivals.set_gains import evidence, set_gains, single_avoidance
from mlci.rivals.traces import crossings, density, nearest, visits
from mlci.worlds.causal_entropy import CausalEntropy
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.inference import infer_table
from mlci.worlds.tables import Table, TablePath, TableRegion

SIDE = 4


def grid_agent(slip: float = 0.0) -> Agent:
    """A 4 x 4 grid: right or down, from corner to corner; each state but the ends a hypothesis."""
    row, column = np.divmod(np.arange(SIDE**2), SIDE)
    right = np.where(column < SIDE - 1, np.arange(SIDE**2) + 1, -1)
    down = np.where(row < SIDE - 1, np.arange(SIDE**2) + SIDE, -1)
    meant = np.stack([right, down], axis=1)
    moves = [np.argwhere(meant == s).tolist() for s in range(SIDE**2)]
    regions = {f"{s}": TableRegion(moves=[tuple(m) for m in moves[s]]) for s in range(SIDE**2)}
    chances = np.zeros((SIDE**2, 2, SIDE**2))
    for s, a in product(range(SIDE**2), range(2)):
        there = meant[s][meant[s] >= 0]
        if meant[s, a] >= 0:
            chances[s, a, there] = slip / len(there)
            chances[s, a, meant[s, a]] += 1 - slip
    table = Table.from_arrays(chances, -1.0, start=0, goals=SIDE**2 - 1, regions=regions)
    return Agent(table, 7, discount=0.9 if slip else 1.0, final=None if slip else table.goals)


def problem_of(agent: Agent, ways: list[list[int]]) -> Problem:
    """What some sequences of actions show; moves lead where they are meant to."""
    shown = []
    for actions in ways:
        states = [0]
        for action in actions:
            states.append(states[-1] + (1 if action == 0 else SIDE))
        path = TablePath(np.array(states), np.array(actions))
        beside = None
        if agent.is_certain:
            world = FixedHorizon(agent.table, agent.steps)
            beside = lambda mask, world=world: world.log_avoidance_beside(0, mask)  # noqa: E731
        crossed = agent.table.crossed_by(path)
        shown.append(Shown(agent, path.states, path.actions, crossed, beside))
    places = np.stack(np.divmod(np.arange(SIDE**2), SIDE), axis=-1).astype(float)
    return Problem(tuple(shown), (SIDE, SIDE), np.eye(SIDE**2, dtype=bool), places)


ROUND = [[0, 0, 0, 1, 1, 1], [1, 1, 1, 0, 0, 0], [0, 0, 0, 1, 1, 1]]  # along the border


def test_gains_where_chance_decides_are_ratios_of_causal_entropy() -> None:
    problem = problem_of(grid_agent(slip=0.2), ROUND)
    rates, agent = Rates(0.1, 0.02), problem.shown[0].agent
    gains = set_gains(problem, rates)
    members = np.isin(np.arange(SIDE**2), [5])
    beside = gains.beside(members)
    paths = [TablePath(each.states, each.actions) for each in problem.shown]
    nominal = np.array([CausalEntropy(agent.table, 7, 0.9).log_probability(p) for p in paths])
    for i in (5, 6, 9):  # with these no slip leads to where every way on is forbidden
        world = CausalEntropy(agent.under(members | (np.arange(SIDE**2) == i)).table, 7, 0.9)
        ratio = np.array([world.log_probability(path) for path in paths]) - nominal
        expected = np.log(0.98 / (0.9 * np.exp(-ratio) + 0.1) + 0.02)
        assert beside[i] == pytest.approx(np.sum(expected), abs=1e-12)
    assert beside[1] == pytest.approx(gains.gain(members | (np.arange(SIDE**2) == 1)), abs=1e-12)
    assert set_gains(problem).beside(members)[1] == -np.inf  # violated, and nobody breaks rules


def test_where_chance_decides_a_ratio_takes_the_place_of_alpha() -> None:
    problem = problem_of(grid_agent(slip=0.2), ROUND)
    agent, path = problem.shown[0].agent, problem.shown[0]
    of_path = TablePath(path.states, path.actions)
    nominal = CausalEntropy(agent.table, 7, 0.9).log_probability(of_path)
    found = single_avoidance(problem)[0]
    for i in (5, 6, 9):
        world = CausalEntropy(agent.under(np.arange(SIDE**2) == i).table, 7, 0.9)
        ratio = nominal - world.log_probability(of_path)
        assert ratio < 0
        assert found[i] == pytest.approx(np.exp(ratio), abs=1e-12)
    assert np.all(found[problem.violated[0]] == 1)


def test_what_a_cell_alone_decides_is_no_forecast() -> None:
    problem = problem_of(grid_agent(), ROUND)
    log_alpha = np.log(np.full(SIDE**2, 0.5))
    at_centres = np.where(np.arange(SIDE**2) == 6, -np.inf, log_alpha)
    path = replace(
        problem.shown[0], avoidance=lambda mask: log_alpha, between_cells=lambda mask: at_centres
    )
    found = single_avoidance(replace(problem, shown=(path,)))[0]
    np.testing.assert_allclose(found, np.where(np.arange(SIDE**2) == 6, 1.0, 0.5))


def test_gains_where_moves_are_certain_are_those_of_the_table() -> None:
    problem = problem_of(grid_agent(), ROUND)
    agent = problem.shown[0].agent
    paths = [TablePath(each.states, each.actions) for each in problem.shown]
    rates = Rates(0.1)
    single = set_gains(problem, rates).beside(np.zeros(SIDE**2, dtype=bool))
    table = infer_table(agent.table, paths, steps=7, rates=rates)
    np.testing.assert_allclose(single, table.ranking.gain, atol=1e-12)
    alpha = FixedHorizon(agent.table, 7).avoidance_probabilities(0)
    np.testing.assert_allclose(single_avoidance(problem)[0], alpha, atol=1e-12)
    np.testing.assert_allclose(printed_avoidance(problem)[0], alpha, atol=1e-12)


def test_evidence_of_ratios_is_bounded_by_the_rates() -> None:
    at_ends = evidence(np.array([-np.inf, 0.0, 1e3]), Rates(0.1, 0.02))
    np.testing.assert_allclose(at_ends, np.log([0.02, 1.0, 0.98 / 0.1 + 0.02]), atol=1e-15)


def test_the_paper_takes_the_likeliest_successor_for_the_only_one() -> None:
    chances = certain(chancy_world()).transitions.toarray().reshape(5, 3, 5)
    assert chances[0].argmax(axis=1).tolist() == [1, 3, 2]
    assert set(np.unique(chances.sum(axis=2))) <= {0.0, 1.0}
    slips = printed_avoidance(problem_of(grid_agent(slip=0.2), ROUND))
    np.testing.assert_allclose(slips[0], printed_avoidance(problem_of(grid_agent(), ROUND))[0])


@pytest.mark.parametrize(("spread", "within"), [(20.0, 0.02), (1.0, 0.05)])
def test_the_penalty_map_balances_expected_and_shown_moves(spread: float, within: float) -> None:
    problem = problem_of(grid_agent(), ROUND)
    agent = problem.shown[0].agent
    penalties = penalty_map(problem, iterations=500, spread=spread)
    expected = agent.table.crosses.T @ agent.with_penalties(penalties).flows
    shown = np.mean([problem.moves_inside(j) for j in range(3)], axis=0)
    gap = expected - shown - 1 / (spread * 3)
    assert np.all(gap[penalties <= 0] < 1e-3)
    # Of what nobody enters the penalty rises ever more slowly, towards where the prior balances.
    np.testing.assert_allclose(gap[penalties > 0], 0, atol=within)
    middle = np.isin(np.arange(SIDE**2), [5, 6, 9, 10])
    assert penalties[middle].sum() > penalties[~middle].sum()


def test_traces_by_hand() -> None:
    problem = problem_of(grid_agent(), ROUND)
    middle = np.isin(np.arange(SIDE**2), [5, 6, 9, 10])
    ways = visits(problem)  # all 20 ways are as likely as each other
    assert ways[5] == pytest.approx(2 * 6 / 20)  # two ways to it, six on from it
    assert ways[3] == pytest.approx(1 / 20 - 2 / 3)
    distance = -nearest(problem)
    assert distance[middle].tolist() == [1, 1, 1, 1]
    assert not distance[[0, 1, 2, 3, 4, 7, 15]].any()
    score = density(problem)
    assert np.min(score[middle]) > np.max(score[[3, 12]])
    share = crossings(problem, 1000, np.random.default_rng(1))
    assert share[5] == pytest.approx(12 / 20, abs=4 * np.sqrt(0.24 / 1000))


@pytest.mark.parametrize("slip", [0.0, 0.2])
def test_demonstrations_of_a_task_count_alike_if_its_agents_are_two(slip: float) -> None:
    one = problem_of(grid_agent(slip), ROUND)
    *others, last = one.shown
    two = replace(one, shown=(*others, replace(last, agent=replace(last.agent))))
    assert [numbers for _, numbers in two.tasks] == [[0, 1], [2]]
    for score in (visits, lambda it: penalty_map(it, iterations=5), density, single_avoidance):
        np.testing.assert_allclose(score(two), score(one), atol=1e-9)
    share = crossings(two, 200, np.random.default_rng(1))
    np.testing.assert_allclose(share, crossings(one, 200, np.random.default_rng(2)), atol=0.2)


def test_of_a_path_that_follows_no_moves_states_count_and_what_it_violates() -> None:
    problem = problem_of(grid_agent(), ROUND)
    violated = np.isin(np.arange(SIDE**2), [1, 6])  # 6 between two of its states
    path = replace(problem.shown[0], states=np.array([0, 1, 1, 7]), actions=None, violated=violated)
    counts = replace(problem, shown=(path,)).moves_inside(0)
    assert np.flatnonzero(counts).tolist() == [0, 1, 6, 7]
    assert counts[[0, 1, 6, 7]].tolist() == [1, 2, 1, 1]


def test_neighbours_share_a_side_and_may_go_round() -> None:
    problem = problem_of(grid_agent(), ROUND)
    assert problem.neighbours[5].nonzero()[1].tolist() == [1, 4, 6, 9]
    assert problem.neighbours[0].nonzero()[1].tolist() == [1, 4]
    wrapped = Problem(problem.shown, (4, 4), problem.inside, problem.positions, (True, False))
    assert wrapped.neighbours[0].nonzero()[1].tolist() == [1, 4, 12]
    along = problem_of(grid_agent(), ROUND[:1])  # the first row, and the last column
    assert -nearest(along)[8] == 2
    assert nearest(replace(along, wraps=(True, False)))[[8, 12]].tolist() == [-2, -1]
    narrow = Problem(problem.shown, (2, 8), problem.inside, problem.positions, (True, False))
    assert narrow.neighbours[0].nonzero()[1].tolist() == [1, 8]
    assert set(narrow.neighbours.data) == {1}  # two that go round share one side more than once


def test_a_problem_needs_demonstrations_and_shapes_that_fit() -> None:
    problem = problem_of(grid_agent(), ROUND)
    with pytest.raises(ValueError, match="there are none"):
        Problem((), (4, 4), problem.inside, problem.positions)
    with pytest.raises(ValueError, match="do not fit"):
        Problem(problem.shown, (5, 5), problem.inside, problem.positions)
