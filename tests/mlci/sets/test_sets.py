"""Belief over sets against Bayes' rule with every trajectory listed, however it is computed."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
import pytest
from scipy import sparse
from scipy.special import gammaln
from toy_tables import random_table, trajectories

from mlci.demonstrations import Demonstration
from mlci.evidence import PAPER, Rates
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.maxent import TrajectoryDistribution
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.sets.evidence import SetEvidence
from mlci.sets.inference import infer_sets
from mlci.sets.posterior import SetPosterior, SetPrior, enumerate_sets
from mlci.sets.sampling import sample_sets
from mlci.spaces import Bools, Box, StateSpace
from mlci.systems import Pendulum
from mlci.tabular import TabularModel, action_grid, discretize
from mlci.worlds.fixed_horizon import FixedHorizon

STEPS = 5
LINE = sparse.csr_matrix(np.eye(4, k=1) + np.eye(4, k=-1))  # neighbours are next in number


def small_world(seed: int, demonstrations: int = 3, rates: Rates = PAPER) -> tuple:
    """Evidence of random paths, and of every trajectory its weight and what it crosses."""
    table = random_table(np.random.default_rng(seed), states=6, actions=3, regions=4, cost=1.0)
    everything, crosses = trajectories(table, steps=STEPS), table.crosses.toarray()
    weights = np.array([weight for weight, _, _ in everything])
    crossed = np.array([crosses[rows].any(axis=0) for _, _, rows in everything])
    paths = np.random.default_rng(1).choice(
        len(weights), size=demonstrations, p=weights / weights.sum()
    )
    distribution = FixedHorizon(table, steps=STEPS)
    beside = partial(distribution.log_avoidance_beside, 0)
    evidence = SetEvidence([beside] * demonstrations, crossed[paths], rates)
    return evidence, weights, crossed, paths


def bayes(
    weights: np.ndarray, crossed: Bools, paths: np.ndarray, prior: SetPrior, rates: Rates
) -> dict[tuple[int, ...], float]:
    """Probability of each set of at most so many regions, from sums over all trajectories."""
    eta, eps = rates.model_error, rates.rule_breaking
    sets = [one for size in range(prior.largest + 1) for one in combinations(range(4), size)]
    joint, alike = [], {size: sum(len(one) == size for one in sets) for size in range(5)}
    for one in sets:
        avoids = ~crossed[:, list(one)].any(axis=1)
        alpha = np.sum(weights[avoids]) / np.sum(weights)
        ratio = (1 - eps) * avoids[paths] / max((1 - eta) * alpha + eta, 1e-300) + eps
        pairs = sum(abs(i - j) == 1 for i, j in combinations(one, 2))
        share = prior.sizes[len(one)] / alike[len(one)]
        joint.append(share * np.exp(prior.adjacency * pairs) * np.prod(ratio))
    return dict(zip(sets, np.array(joint) / np.sum(joint), strict=True))


PAIRS = SetPrior((0.3, 0.5, 0.2))
ALL = SetPrior((0.3, 0.3, 0.2, 0.15, 0.05))
ISING = SetPrior((0.2, 0.2, 0.2, 0.2, 0.2), adjacency=0.7, neighbours=LINE)


@pytest.mark.parametrize("seed", [0, 2, 5, 7])
@pytest.mark.parametrize("prior", [PAIRS, ALL, ISING])
@pytest.mark.parametrize("rates", [PAPER, Rates(0.1, 0.05)])
def test_enumeration_is_bayes_rule_with_every_trajectory_listed(
    seed: int, prior: SetPrior, rates: Rates
) -> None:
    evidence, *world = small_world(seed, rates=rates)
    expected = bayes(*world, prior, rates)
    result = enumerate_sets(evidence, prior)
    for one, probability in expected.items():
        assert result.probability_of(one) == pytest.approx(probability, abs=1e-10)
    assert result.none == pytest.approx(expected[()], abs=1e-10)
    forbidden = [sum(p for one, p in expected.items() if i in one) for i in range(4)]
    np.testing.assert_allclose(result.marginal, forbidden, atol=1e-10)
    sizes = [sum(p for one, p in expected.items() if len(one) == k) for k in range(5)]
    np.testing.assert_allclose(result.sizes, sizes, atol=1e-10)
    assert expected[result.most_probable()] == pytest.approx(max(expected.values()), abs=1e-10)


@pytest.mark.parametrize("prior", [ALL, ISING])
def test_a_sample_agrees_with_enumeration(prior: SetPrior) -> None:
    evidence, *_ = small_world(2, demonstrations=2, rates=Rates(0.1, 0.3))
    exact = enumerate_sets(evidence, prior)
    sample = sample_sets(evidence, prior, np.random.default_rng(3), steps=1000)
    assert sample.check is not None
    assert sample.check.agrees
    # Four standard errors: a right sampler fails one in 4000 of the five times two.
    error = sample.check.standard_error
    assert np.all(np.abs(sample.marginal - exact.marginal) < 4 * error[:-1])
    mean = sample.sizes @ np.arange(5), exact.sizes @ np.arange(5)
    assert abs(mean[0] - mean[1]) < 4 * error[-1]
    assert error[:-1].max() < 0.05
    assert sample.most_probable() == exact.most_probable()
    # Gains and weights of a sample are exact.
    known = {tuple(row): k for k, row in enumerate(exact.members)}
    place = [known[tuple(row)] for row in sample.members]
    np.testing.assert_allclose(sample.gain, exact.gain[place], atol=1e-10)
    np.testing.assert_allclose(sample.weight, exact.weight[place], atol=1e-10)


def test_a_sample_is_told_by_its_seed_and_never_breaks_a_rule() -> None:
    evidence, *_ = small_world(2, demonstrations=2)
    first, second, other = (
        sample_sets(evidence, ALL, np.random.default_rng(seed), steps=50) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first.members, second.members)
    np.testing.assert_array_equal(first.probability, second.probability)
    assert first.probability.shape != other.probability.shape or np.any(
        first.probability != other.probability
    )
    assert not np.any(first.members & evidence.violated.any(axis=0))


def small_model() -> TabularModel:
    system = Pendulum()
    regions = Regions.from_grid(system.space, (6, 5))
    grid, actions = Grid(system.space, (20, 20)), action_grid(system, 9)
    return discretize(system, grid, actions, 0.25, regions)


@pytest.mark.parametrize("exact_ends", [False, True])
def test_joint_avoidance_is_the_ratio_of_partitions(exact_ends: bool) -> None:
    """alpha of a set = Z under the set / Z, also where the first and last moves are of states."""
    model = small_model()
    demonstration = Demonstration.from_path([[0.5, 0.0], [3.0, 0.1]], 3.0)
    free = TrajectoryDistribution.of_task(model, demonstration.task, exact_ends=exact_ends)
    alone = free.avoidance_probabilities()
    some = [0, *np.flatnonzero(alone < 0.999)]
    nothing = np.zeros(len(alone), dtype=bool)
    np.testing.assert_allclose(np.exp(free.log_avoidance_beside(nothing)), alone, rtol=1e-12)
    start, most = free.start, 0.0
    for others in ([], *([i] for i in some), some[1:3]):
        mask = np.isin(np.arange(len(model.regions)), others)
        beside = free.log_avoidance_beside(mask)
        for j in some:
            both = mask | (np.arange(len(mask)) == j)
            under = replace(free, model=model.under(both))
            expected = under.log_z[0, start] - free.log_z[0, start]
            assert beside[j] == pytest.approx(expected, abs=1e-10)
            if len(others) == 1 and j != others[0]:
                most = max(most, abs(np.exp(beside[j]) - alone[j] * alone[others[0]]))
    assert most > 0.1  # far from independent


def test_what_the_others_make_impossible_is_certain_to_be_entered() -> None:
    evidence, *_ = small_world(5)
    everything = np.ones(4, dtype=bool)
    assert np.all(evidence.avoidance[0](everything) <= 0)  # type: ignore[misc]


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
        result = infer_sets(model, demonstrations, each, SetPrior((0.5, 0.5)))
        np.testing.assert_allclose(result.marginal, each.posterior, atol=1e-12)
        assert result.none == pytest.approx(each.posterior_none, abs=1e-12)


def test_too_many_sets_are_sampled_by_the_options_that_are_given() -> None:
    model, prior = small_model(), SetPrior.geometric(0.5, 0.5, 6)
    demonstrations, _ = inferred(model)
    inference = infer(model, demonstrations, exact_ends=False)
    evidence = SetEvidence.of(model, demonstrations, inference, exact_ends=False)
    result, again = (
        infer_sets(
            *(model, demonstrations, inference, prior),
            **{"rng": rng, "chains": 2, "steps": 20, "exact_ends": False},
        )
        for rng in (np.random.default_rng(4), None)
    )
    for each, seed in ((result, 4), (again, 0)):
        same = sample_sets(evidence, prior, np.random.default_rng(seed), chains=2, steps=20)
        np.testing.assert_array_equal(each.members, same.members)
        np.testing.assert_array_equal(each.weight, same.weight)
        assert len(np.unique(each.members, axis=0)) > 1


def test_hypotheses_may_be_some_of_the_models_regions() -> None:
    model = small_model()
    demonstrations, _ = inferred(model)
    some = np.arange(30) % 3 == 0
    inference = infer(model, demonstrations, hypotheses=some)
    prior = SetPrior((0.4, 0.3, 0.3))
    result = infer_sets(model, demonstrations, inference, prior, hypotheses=some)
    fewer = replace(model, regions=model.regions.select(some), kept=None, truth=np.zeros(0, bool))
    alone = infer_sets(fewer, demonstrations, infer(fewer, demonstrations), prior)
    np.testing.assert_allclose(result.marginal, alone.marginal, atol=1e-12)


def test_a_silent_region_adds_nothing_to_another() -> None:
    model = small_model()
    demonstrations, inference = inferred(model)
    other, quiet = np.argsort(-np.where(inference.gain < np.inf, inference.gain, -np.inf))[:2]
    silent = np.zeros(inference.violated.shape, dtype=bool)
    silent[:, quiet] = True
    inference = replace(inference, violated=silent & False, decided_by_cell=silent)
    evidence = SetEvidence.of(model, demonstrations, inference)
    mask = np.arange(30) == other
    assert evidence.gain(mask) > 0.1  # it says something itself
    assert evidence.gain(np.arange(30) == quiet) == 0
    assert evidence.beside(mask)[quiet] == pytest.approx(evidence.gain(mask), abs=1e-12)
    with_silent = mask | (np.arange(30) == quiet)
    np.testing.assert_allclose(evidence.beside(with_silent), evidence.beside(mask), atol=1e-12)


def test_the_first_demonstrations_alone() -> None:
    """With the rates, and with what is silent of them."""
    model = small_model()
    demonstrations, inference = inferred(model)
    silent = np.zeros(inference.violated.shape, dtype=bool)
    silent[0, np.argmax(inference.gain)] = True
    inference = replace(inference, rates=Rates(0.1, 0.2), decided_by_cell=silent)
    first = SetEvidence.of(model, demonstrations, inference).of_some([0])
    again = SetEvidence.of(model, demonstrations[:1], inference.of(slice(1)))
    for mask in (np.isin(np.arange(30), [13, 14]), np.zeros(30, dtype=bool)):
        np.testing.assert_array_equal(first.beside(mask), again.beside(mask))
    assert np.any(first.beside(mask) != 0)


def test_a_task_that_cannot_be_done_says_nothing_by_what_it_avoids() -> None:
    violated = np.array([[True, False, False]])
    evidence = SetEvidence([None], violated, Rates(0.0, 0.1))
    nothing = np.zeros(3, dtype=bool)
    np.testing.assert_allclose(evidence.beside(nothing), [np.log(0.1), 0, 0], atol=1e-15)


def test_an_unavoidable_set_takes_all_the_probability_or_refuses_to_be_sampled() -> None:
    def beside(others: Bools) -> np.ndarray:
        return np.where(others.any() | np.array([False, True]), -np.inf, np.log(0.5))

    evidence = SetEvidence([beside], np.zeros((1, 2), dtype=bool))
    result = enumerate_sets(evidence, SetPrior((0.5, 0.3, 0.2)))
    assert result.none == 0
    assert result.probability_of([1]) == pytest.approx(0.15 / 0.35)
    assert result.probability_of([0, 1]) == pytest.approx(0.2 / 0.35)
    with pytest.raises(ValueError, match="sample with a model error above 0"):
        sample_sets(evidence, SetPrior((0.5, 0.3, 0.2)), np.random.default_rng(0))


def hand_made(prior: SetPrior) -> SetPosterior:
    """Evidence in which regions 0 and 1 explain alike, and 2 nothing."""

    def beside(others: Bools) -> np.ndarray:
        sets = others | np.eye(3, dtype=bool)
        return np.log(np.where(sets[:, 0] | sets[:, 1], 0.25, 1.0))

    return enumerate_sets(SetEvidence([beside], np.zeros((1, 3), dtype=bool)), prior)


def test_what_a_posterior_says() -> None:
    result = hand_made(SetPrior((0.2, 0.4, 0.2, 0.2)))
    frame = result.to_frame(["a", "b", "c"])
    weight = {"": 0.2, "a": 1.6 / 3, "b": 1.6 / 3, "c": 0.4 / 3, "a, b, c": 0.8}
    weight |= {"a, b": 0.8 / 3, "a, c": 0.8 / 3, "b, c": 0.8 / 3}
    total = sum(weight.values())
    assert frame["set"].iloc[0] == "a, b, c"
    for row in frame.itertuples():
        assert row.probability == pytest.approx(weight[row.set] / total)
        assert row.gain == pytest.approx(np.log(4) if {"a", "b"} & set(row.set) else 0, abs=1e-12)
        assert row.size == len(row.set.replace(", ", ""))
    assert result.most_probable() == (0, 1, 2)
    # By marginals a and b come first: none, a, b, and both are inside of {a, b}.
    inside = (weight[""] + weight["a"] + weight["b"] + weight["a, b"]) / total
    np.testing.assert_array_equal(result.credible_regions(inside), [0, 1])
    np.testing.assert_array_equal(result.credible_regions(inside + 1e-6), [0, 1, 2])
    np.testing.assert_array_equal(result.credible_regions(weight[""] / total), [])


def test_areas_join_neighbours_with_much_of_the_largest_marginal() -> None:
    result = hand_made(SetPrior((0.2, 0.8)))
    space = StateSpace(Box([0.0], [6.0]), [False], ("x",), ("m",))
    apart = Regions.from_boxes(space, [Box([0.0], [1.0]), Box([4.0], [5.0]), Box([1.0], [2.0])])
    first, second = result.areas(apart)
    assert [first.regions.tolist(), second.regions.tolist()] == [[0], [1]]
    assert first.probability == pytest.approx(result.marginal[0])
    whole, other = result.areas(apart, share=0.1)
    assert [whole.regions.tolist(), other.regions.tolist()] == [[0, 2], [1]]
    assert whole.probability == pytest.approx(1 - result.none - result.marginal[1])


def test_a_geometric_prior_and_neighbours() -> None:
    prior = SetPrior.geometric(0.4, 0.5, 3, adjacency=2.0, neighbours=LINE + sparse.eye(4))
    np.testing.assert_allclose(prior.sizes, [0.4, 0.6 * 4 / 7, 0.6 * 2 / 7, 0.6 / 7])
    three = np.array([True, True, True, False])
    assert prior.log(three) == pytest.approx(np.log(0.6 / 7 / 4) + 4.0)
    assert prior.log_beside(np.array([True, False, True, False]))[1] == prior.log(three)
    many = SetPrior.geometric(0.5, 0.99, 100)  # there are 1e29 sets of 50
    half = np.arange(100) < 50
    logs = gammaln(101) - 2 * gammaln(51)
    assert many.log(half) == pytest.approx(np.log(many.sizes[50]) - logs)
    assert prior.log_beside(three).tolist() == [prior.log(three)] * 3 + [-np.inf]


def test_independent_regions_have_their_odds() -> None:
    prior = SetPrior.independent(4, -1.5, adjacency=0.75, neighbours=LINE)
    nothing, three = np.zeros(4, dtype=bool), np.array([True, True, False, True])
    assert prior.log(three) - prior.log(nothing) == pytest.approx(3 * -1.5 + 0.75)
    assert prior.largest == 4


def test_what_does_not_fit_is_refused() -> None:
    violated = np.zeros((1, 2), dtype=bool)
    with pytest.raises(ValueError, match=r"2 tasks do not fit violated \(1, 2\)"):
        SetEvidence([None, None], violated)
    with pytest.raises(ValueError, match=r"add up to 1, not \(0.5, 0.5, 0.5\)"):
        SetPrior((0.5, 0.5, 0.5))
    with pytest.raises(ValueError, match="needs to be told who are neighbours"):
        SetPrior(adjacency=1.0)
    with pytest.raises(ValueError, match="a chain and four steps, not 4 and 3"):
        sample_sets(SetEvidence([None], violated), PAIRS, np.random.default_rng(0), steps=3)
    many = SetEvidence([None], np.zeros((1, 14), dtype=bool))
    with pytest.raises(ValueError, match="sets of up to 14 of 14 regions are too many"):
        enumerate_sets(many, SetPrior.geometric(0.5, 0.5, 14))
    model = small_model()
    demonstrations, inference = inferred(model)
    with pytest.raises(ValueError, match="1 demonstrations and 30 regions do not fit"):
        infer_sets(model, demonstrations[:1], inference)
    strange = SetPrior(neighbours=sparse.csr_matrix((5, 5)), adjacency=1.0)
    with pytest.raises(ValueError, match=r"neighbours \(5, 5\) of a prior must be \(30, 30\)"):
        infer_sets(model, demonstrations, inference, strange)


@pytest.mark.parametrize("worlds", [60, pytest.param(500, marks=pytest.mark.long)])
def test_beliefs_come_true_as_often_as_they_are_probable(worlds: int) -> None:
    """Truths drawn from the prior, and paths from the trajectories that avoid them: over all worlds
    and regions, as many are forbidden as marginals say, in each third of the probabilities."""
    marginals, forbidden = [], []
    for world in range(worlds):
        rng = np.random.default_rng([7, world])
        table = random_table(rng, states=6, actions=3, regions=4, cost=1.0)
        everything, crosses = trajectories(table, steps=4), table.crosses.toarray()
        weights = np.array([weight for weight, _, _ in everything])
        crossed = np.array([crosses[rows].any(axis=0) for _, _, rows in everything])
        if not len(weights):
            continue
        truth = np.zeros(4, dtype=bool)
        truth[rng.choice(4, rng.choice(5, p=ALL.sizes), replace=False)] = True
        allowed = weights * ~crossed[:, truth].any(axis=1)
        if not allowed.sum() > 0:
            continue  # a truth that allows no path has no likelihood either
        paths = rng.choice(len(weights), size=2, p=allowed / allowed.sum())
        beside = partial(FixedHorizon(table, steps=4).log_avoidance_beside, 0)
        posterior = enumerate_sets(SetEvidence([beside] * 2, crossed[paths]), ALL)
        marginals.append(posterior.marginal)
        forbidden.append(truth)
    p, hit = np.ravel(marginals), np.ravel(forbidden)
    assert len(marginals) > worlds / 3
    for low, high in ((0, 0.2), (0.2, 0.45), (0.45, 1)):
        some = (p >= low) & (p <= high)
        # Three deviations, if regions of a world were independent of each other.
        deviation = np.sqrt(np.sum(p[some] * (1 - p[some])))
        assert abs(np.sum(hit[some] - p[some])) < 3 * deviation + 1e-9
