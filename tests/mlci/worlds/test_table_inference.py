"""Evidence about hypotheses of a table: against sums over trajectories, and policies by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toy_tables import chancy_world, published_grid, random_table, trajectories

from mlci.evidence import Rates, log_evidence
from mlci.worlds.causal_entropy import CausalEntropy
from mlci.worlds.first_exit import FirstExit
from mlci.worlds.inference import TableInference, infer_table, is_certain
from mlci.worlds.tables import Table, TablePath, TableRegion

RATES = Rates(0.1, 0.05)


def chancy_table() -> Table:
    """The world of chance, with each state and each action as a hypothesis."""
    world = chancy_world()
    regions = {f"state {s}": TableRegion(states=[s]) for s in range(5)}
    regions |= {f"action {a}": TableRegion(actions=[a]) for a in range(3)}
    regions["risk"] = TableRegion(moves=[(1, 0), (2, 0)])
    return Table.from_arrays(world.transitions, world.reward, world.start, (), regions)


@pytest.mark.parametrize("seed", range(4))
def test_fixed_horizon_is_the_sum_over_trajectories(seed: int) -> None:
    table = random_table(np.random.default_rng(seed), states=5, actions=3, regions=6)
    every = trajectories(table, 5)
    total = sum(weight for weight, _, _ in every)
    paths = [TablePath(states, [row % 3 for row in rows]) for _, states, rows in every[:5]]
    assert paths
    inference = infer_table(table, paths, steps=5, rates=RATES)
    crosses = table.crosses.toarray()
    alpha = np.array(
        [sum(w for w, _, rows in every if not crosses[rows, i].any()) / total for i in range(6)]
    )
    for j, (_, _, rows) in enumerate(every[:5]):
        crossed = crosses[rows].any(axis=0)
        with np.errstate(divide="ignore"):
            expected = np.where(crossed, -np.inf, -np.log(alpha))
        np.testing.assert_allclose(inference.log_ratio[j], expected, atol=1e-12)
    violated = np.array([crosses[rows].any(axis=0) for _, _, rows in every[:5]])
    evidence = log_evidence(np.tile(alpha, (len(paths), 1)).clip(0, 1), violated, RATES)
    np.testing.assert_allclose(inference.evidence, evidence, atol=1e-12)


def test_first_exit_is_z_with_and_without_each_hypothesis() -> None:
    table = published_grid()
    path = table.path(0, [1, 1, 1, 1, 5, 1, 7, 1])
    inference = infer_table(table, [path])
    nominal = FirstExit(table).log_z[0]
    for i, mask in enumerate(np.eye(91, dtype=bool)):
        if not inference.violated[0, i]:
            ratio = nominal - FirstExit(table.under(mask)).log_z[0]
            assert inference.log_ratio[0, i] == pytest.approx(ratio, abs=1e-10)
    assert inference.violated[0].sum() == 13  # 9 states, three actions, green


def test_probabilities_that_underflow_keep_their_logarithm() -> None:
    """One way costs 1000 nat more than the other."""
    successor = np.array([[1, 2], [3, -1], [3, -1], [-1, -1]])
    reward = np.array([[-1.0, -1000.0], [-1.0, 0.0], [-2.0, 0.0], [0.0, 0.0]])
    table = Table.from_arrays(successor, reward, 0, 3, {"cheap": TableRegion(states=[1])})
    inference = infer_table(table, [TablePath([0, 2, 3], [1, 0])], rates=Rates())
    assert inference.log_ratio[0, 0] == pytest.approx(1000, abs=1e-9)
    assert inference.ranking.gain[0] == pytest.approx(1000, abs=1e-9)


@pytest.mark.parametrize(("steps", "discount"), [(4, 1.0), (4, 0.8), (None, 0.9)])
def test_where_chance_decides_it_is_the_ratio_of_two_policies(
    steps: int | None, discount: float
) -> None:
    table = chancy_table()
    assert not is_certain(table)
    paths = [TablePath([0, 1, 4, 0, 2], [0, 2, 1, 2]), TablePath([4, 0, 2, 4, 0], [0, 2, 2, 1])]
    inference = infer_table(table, paths, steps=steps, discount=discount, rates=RATES)
    agent = CausalEntropy(table, steps, discount)
    for i, mask in enumerate(np.eye(len(table.regions), dtype=bool)):
        other = CausalEntropy(table.under(mask), steps, discount)
        for j, path in enumerate(paths):
            expected = 0.0
            for t, (s, a) in enumerate(zip(path.states, path.actions, strict=False)):
                with np.errstate(divide="ignore"):
                    expected += np.log(other.policy(t)[s, a]) - np.log(agent.policy(t)[s, a])
            assert inference.log_ratio[j, i] == pytest.approx(expected, abs=1e-9), (i, j)
    assert inference.violated[0].tolist() == [True, True, True, False, True] + [True] * 3 + [False]
    assert 0 < inference.log_ratio[0, 8] < np.inf  # nobody took the risk
    with np.errstate(divide="ignore", over="ignore"):
        counts = np.log(0.95 / (0.9 * np.exp(-inference.log_ratio) + 0.1) + 0.05)
    np.testing.assert_allclose(inference.evidence, counts, atol=1e-12)


def test_both_models_agree_where_moves_are_certain() -> None:
    table = published_grid()
    path = table.path(0, [1, 1, 1, 1, 5, 1, 7, 1])
    inference = infer_table(table, [path])
    nominal = CausalEntropy(table).log_probability(path)
    for i in (20, 40, 83, 90):
        mask = np.arange(91) == i
        ratio = CausalEntropy(table.under(mask)).log_probability(path) - nominal
        assert inference.log_ratio[0, i] == pytest.approx(ratio, abs=1e-8)


def test_evidence_lies_between_the_rates() -> None:
    ratio = np.array([[-np.inf, -800.0, -1.0, 0.0, 1.0, 800.0, np.inf]])
    inference = TableInference(tuple("abcdefg"), ("p",), ratio, ratio == -np.inf, 0.5, RATES)
    evidence = inference.evidence[0]
    assert np.all(np.diff(evidence) >= 0)
    assert evidence[[0, 1]] == pytest.approx(np.log(0.05))
    assert evidence[[5, 6]] == pytest.approx(np.log(0.95 / 0.1 + 0.05))
    assert evidence[3] == pytest.approx(0)
    paper = replace(inference, rates=Rates())
    np.testing.assert_allclose(paper.evidence, ratio)
    assert paper.ranking.posterior[6] == 1
    assert paper.to_frame()["hypothesis"][0] == "g"


def test_a_path_that_ends_in_a_goal_early_has_a_probability() -> None:
    """Under a horizon of causal entropy, whose goals end a path."""
    chances = np.zeros((3, 2, 3))
    chances[0, 0, [0, 1]] = 0.5
    chances[0, 1, 2] = chances[1, :, 2] = 1.0
    table = Table.from_arrays(chances, -1.0, 0, 2, {"middle": TableRegion(states=[1])})
    path = TablePath([0, 2], [1])
    agent = CausalEntropy(table, 5)
    assert agent.log_probability(path) == pytest.approx(np.log(agent.policy(0)[0, 1]))
    assert infer_table(table, [path], steps=5).log_ratio[0, 0] == pytest.approx(
        -np.log(agent.policy(0)[0, 1])
    )
    with pytest.raises(ValueError, match="2 actions, the horizon 5"):
        agent.log_probability(TablePath([0, 0, 0], [0, 0]))


def test_what_cannot_be_ranked_is_refused() -> None:
    table = replace(published_grid(), regions={})
    with pytest.raises(ValueError, match="give the table regions"):
        infer_table(table, [])
    with pytest.raises(ValueError, match=r"log_ratio \(1, 2\) and violated \(1, 1\) do not fit"):
        TableInference(("a",), ("p",), np.zeros((1, 2)), np.zeros((1, 1), dtype=bool))
    nothing = infer_table(published_grid(), [])
    assert nothing.ranking.posterior_none == pytest.approx(0.5)
