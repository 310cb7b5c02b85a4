"""Belief over sets against Bayes' rule with every trajectory listed."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from toy_tables import random_table, trajectories

from mlci.demonstrations import Demonstration
from mlci.evidence import Rates
from mlci.fixed_horizon import FixedHorizon
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.maxent import TrajectoryDistribution
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.sets import infer_sets, set_posterior
from mlci.systems import Pendulum
from mlci.tabular import TabularModel, action_grid, discretize


@pytest.mark.parametrize("seed", [0, 2, 5, 7])
def test_posterior_is_bayes_rule_with_every_trajectory_listed(seed: int) -> None:
    table = random_table(np.random.default_rng(seed), states=6, actions=3, regions=4, cost=1.0)
    everything, crosses = trajectories(table, steps=5), table.crosses.toarray()
    weights = np.array([weight for weight, _, _ in everything])
    crossed = np.array([crosses[rows].any(axis=0) for _, _, rows in everything])
    paths = np.random.default_rng(1).choice(len(weights), size=3, p=weights / weights.sum())
    prior = {0: 0.3, 1: 0.5, 2: 0.2}
    sets = [one for size in prior for one in combinations(range(4), size)]
    likelihood = {}
    for one in sets:
        avoids = ~crossed[:, list(one)].any(axis=1)
        chance = weights * avoids / max(np.sum(weights[avoids]), 1e-300)
        share = prior[len(one)] / sum(len(other) == len(one) for other in sets)
        likelihood[one] = share * np.prod(chance[paths])
    total = sum(likelihood.values())
    joint = FixedHorizon(table, steps=5).joint_avoidance_probabilities(0)
    result = set_posterior(np.array([joint] * 3), crossed[paths], tuple(prior.values()))
    assert result.none == pytest.approx(likelihood[()] / total, abs=1e-10)
    for one in sets[1:]:
        expected = likelihood[one] / total
        assert result.probability[one[0], one[-1]] == pytest.approx(expected, abs=1e-10)
    forbidden = [sum(likelihood[one] for one in sets if i in one) / total for i in range(4)]
    np.testing.assert_allclose(result.marginal, forbidden, atol=1e-10)
    assert np.sum(np.tril(result.probability, -1)) == 0
    assert result.most_probable() == max(sets, key=lambda one: likelihood[one])


def small_model() -> TabularModel:
    system = Pendulum()
    regions = Regions.from_grid(system.space, (6, 5))
    grid, actions = Grid(system.space, (20, 20)), action_grid(system, 9)
    return discretize(system, grid, actions, 0.25, regions)


@pytest.mark.parametrize("exact_ends", [False, True])
def test_joint_avoidance_is_the_ratio_of_partitions(exact_ends: bool) -> None:
    """alpha_ij = Z under both / Z, also where the first and last moves are of states."""
    model = small_model()
    demonstration = Demonstration.from_path([[0.5, 0.0], [3.0, 0.1]], 3.0)
    free = TrajectoryDistribution.of_task(model, demonstration.task, exact_ends=exact_ends)
    joint, alone = free.joint_avoidance_probabilities(), free.avoidance_probabilities()
    np.testing.assert_array_equal(np.diag(joint), alone)
    np.testing.assert_array_equal(joint, joint.T)
    start, most = free.start, 0.0
    for i, j in combinations([0, *np.flatnonzero(alone < 0.999)], 2):
        mask = np.isin(np.arange(len(model.regions)), [i, j])
        under = replace(free, model=model.under(mask))
        expected = np.exp(under.log_z[0, start] - free.log_z[0, start])
        assert joint[i, j] == pytest.approx(expected, rel=1e-10, abs=1e-300)
        most = max(most, abs(joint[i, j] - alone[i] * alone[j]))
    assert most > 0.1  # far from independent


def test_evidence_of_a_pair_has_the_rates_of_one() -> None:
    joint = np.array([[[0.5, 0.2], [0.2, 0.4]], [[0.9, 0.6], [0.6, 0.7]]])
    violated = np.array([[False, False], [True, False]])
    result = set_posterior(joint, violated, rates=Rates(model_error=0.1, rule_breaking=0.05))
    of_pair = np.log(0.95 / (0.9 * 0.2 + 0.1) + 0.05) + np.log(0.05)
    assert result.gain[0, 1] == pytest.approx(of_pair)
    assert result.gain[1, 1] == pytest.approx(
        np.log(0.95 / (0.9 * 0.4 + 0.1) + 0.05) + np.log(0.95 / (0.9 * 0.7 + 0.1) + 0.05)
    )


def inferred(model: TabularModel) -> tuple[list[Demonstration], Inference]:
    paths = [[[0.5, 0.1], [2.0, 1.0], [3.0, 0.2]], [[4.0, 0.1], [2.5, -1.0], [1.0, -0.2]]]
    demonstrations = [Demonstration.from_path(path, 1.5) for path in paths]
    return demonstrations, infer(model, demonstrations)


def test_without_pairs_it_is_the_inference() -> None:
    """With no prior for pairs, the belief of `infer`, its rates and silent cells included."""
    model = small_model()
    demonstrations, inference = inferred(model)
    silent = np.zeros(inference.violated.shape, dtype=bool)
    silent[0, 1] = True
    for each in (inference, replace(inference, decided_by_cell=silent)):
        result = infer_sets(model, demonstrations, each, prior=(0.5, 0.5, 0.0))
        np.testing.assert_allclose(np.diag(result.probability), each.posterior, atol=1e-12)
        assert result.none == pytest.approx(each.posterior_none, abs=1e-12)


def test_a_silent_region_adds_nothing_to_another() -> None:
    model = small_model()
    demonstrations, inference = inferred(model)
    silent = np.zeros(inference.violated.shape, dtype=bool)
    silent[:, 1] = True
    inference = replace(inference, violated=silent & False, decided_by_cell=silent)
    gain = infer_sets(model, demonstrations, inference).gain
    assert gain[1, 1] == 0
    assert gain[0, 1] == pytest.approx(gain[0, 0], abs=1e-12)
    assert gain[1, 2] == pytest.approx(gain[2, 2], abs=1e-12)


def test_a_row_a_set() -> None:
    joint = np.array([[[0.5, 0.1], [0.1, 0.4]]])
    result = set_posterior(joint, np.zeros((1, 2), dtype=bool), prior=(0.2, 0.4, 0.4))
    frame = result.to_frame(["a", "b"])
    assert frame["first"].fillna("-").tolist() == ["a", "b", "a", "-"]
    assert frame["second"].fillna("-").tolist() == ["b", "-", "-", "-"]
    weight = np.array([0.4 / 0.1, 0.2 / 0.4, 0.2 / 0.5, 0.2])
    np.testing.assert_allclose(frame["probability"], weight / weight.sum())
    assert result.most_probable() == (0, 1)


def test_what_does_not_fit_is_refused() -> None:
    violated = np.zeros((1, 2), dtype=bool)
    with pytest.raises(ValueError, match=r"joint_avoidance \(1, 2, 3\) and violated \(1, 2\)"):
        set_posterior(np.ones((1, 2, 3)), violated)
    with pytest.raises(ValueError, match=r"adds up to 1, not \(0.5, 0.5, 0.5\)"):
        set_posterior(np.ones((1, 2, 2)), violated, prior=(0.5, 0.5, 0.5))
    model = small_model()
    demonstrations, inference = inferred(model)
    with pytest.raises(ValueError, match="1 demonstrations and 30 regions do not fit"):
        infer_sets(model, demonstrations[:1], inference)
