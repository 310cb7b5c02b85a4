"""Our methods: of one region, selection of several, and the posterior over sets.

A method is a function from a problem and a generator to an answer, and a line in `METHODS`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from experiments.field.entries import Answer, Method
from mlci.evidence import Rates, posterior
from mlci.rivals.problem import Problem
from mlci.rivals.set_gains import set_gains, single_avoidance
from mlci.rule_breaking import estimate_rule_breaking
from mlci.sets.posterior import SetPosterior, SetPrior
from mlci.sets.sampling import sample_sets
from mlci.sets.search import search
from mlci.spaces import Bools, Floats

RATES = Rates(model_error=0.1)  # the default of `mlci.infer`
LEAST = 0.1  # [nat a demonstration], the stop of Scobee and Sastry
NEVER = 1e-100  # the model error of what has none: an infinite gain could not be sampled
STEPS = 200  # of each of two chains over sets, after half as many that do not count


def single(problem: Problem, _rng: np.random.Generator) -> Answer:
    """The posterior of one region or none."""
    gains = set_gains(problem, RATES).beside(np.zeros(problem.regions, dtype=bool))
    probability, none = posterior(gains)
    best = np.arange(problem.regions) == np.argmax(gains)
    return Answer(gains, best & (probability > none), probability)


def greedy(problem: Problem, _rng: np.random.Generator) -> Answer:
    """One region after the other, each given those before, as long as it explains enough."""
    gains = set_gains(problem, _rates(problem))
    count = len(problem.shown)

    def decreases(mask: np.ndarray, candidates: np.ndarray) -> Floats:
        return np.asarray((gains.beside(mask)[candidates] - gains.gain(mask)) / count)

    added, _, _ = search(decreases, gains.feasible, LEAST)
    chosen = np.isin(np.arange(problem.regions), added)
    scores = gains.beside(chosen)
    scores[added] = scores.max() + np.arange(len(added), 0, -1)
    return Answer(scores, chosen)


def sets(problem: Problem, _rng: np.random.Generator) -> Answer:
    """The posterior over sets of regions: those that it expects to overlap most with the truth."""
    return _of_sets(_belief(problem, _rates(problem)))


def with_rates(problem: Problem, _rng: np.random.Generator) -> Answer:
    """The same, with the rate of rule breaking that makes the demonstrations most likely."""
    singles = single_avoidance(problem)
    rates = _rates(problem)
    estimate = estimate_rule_breaking(singles, problem.violated, rates.model_error)
    return _of_sets(_belief(problem, replace(rates, rule_breaking=min(estimate.rate, 0.5))))


def ranked(problem: Problem, _rng: np.random.Generator) -> Answer:
    """Regions by the same posterior, of which as many are taken as are true.

    Of equally probable ones, as of those that no sampled set holds, that comes first which is the
    likelier beside the most probable set. Where that is the empty one, the likelier comes first in
    any case: small marginals are mostly the sample's error.
    """
    rates = _rates(problem)
    belief = _belief(problem, rates)
    best = np.isin(np.arange(problem.regions), belief.most_probable())
    beside = set_gains(problem, rates).beside(best) + _prior(problem).log_beside(best)
    marginal = belief.marginal if np.any(best) else np.zeros(problem.regions)
    scores = np.empty(problem.regions)
    scores[np.lexsort((beside, marginal))] = np.arange(problem.regions)
    return Answer(np.where(problem.feasible, scores, -np.inf))


def _rates(problem: Problem) -> Rates:
    """Of sets: none where paths follow the table's moves, else as of the study `areas`."""
    return Rates(NEVER if problem.shown[0].actions is not None else 0.01)


def _prior(problem: Problem) -> SetPrior:
    """Each region has odds of 1 to C, and of sets that hang together the border alone counts."""
    odds = -float(np.log(problem.regions))
    return SetPrior.independent(problem.regions, odds, -odds / 2, problem.neighbours)


@lru_cache(maxsize=2)
def _belief(problem: Problem, rates: Rates) -> SetPosterior:
    """A sample of sets, which methods share, so that it has a seed of its own."""
    gains, rng = set_gains(problem, rates), np.random.default_rng(0)
    return sample_sets(gains, _prior(problem), rng, chains=2, steps=STEPS)


def _of_sets(belief: SetPosterior) -> Answer:
    """Marginals, and the regions that the posterior expects to overlap most with what is true."""
    marginal = belief.marginal
    return Answer(np.where(marginal > 0, marginal, -np.inf), most_overlap(belief), marginal)


def most_overlap(belief: SetPosterior) -> Bools:
    """(C,) as many of the first regions by marginals as have the largest expected IoU.

    None are taken if it is likelier that there is none than any number of them would overlap.
    """
    order = np.argsort(-belief.marginal, kind="stable")
    both = np.cumsum(belief.members[:, order], axis=1)  # (B, C), of each sampled set
    either = np.arange(1, len(order) + 1) + both[:, -1:] - both
    expected = np.append(belief.none, belief.probability @ (both / either))
    return np.isin(np.arange(len(order)), order[: int(np.argmax(expected))])


METHODS = {
    "ours: single": Method(single, "this project: `mlci.infer`"),
    "ours: greedy": Method(
        greedy, "this project: `mlci.select_regions`, stop of Scobee and Sastry"
    ),
    "ours: sets": Method(
        sets,
        "this project: `mlci.infer_sets`, with a prior by the border",
        "takes the regions of the largest expected IoU, where others take what is likelier than "
        "not",
    ),
    "ours: with rates": Method(
        with_rates,
        "this project: sets, rate of rule breaking estimated",
        "where that rate is 0 the sample is that of `ours: sets`, whose time does not count again",
    ),
    "ours: ranked": Method(
        ranked,
        "this project: regions by the marginals of `ours: sets`",
        "the sample is that of `ours: sets`, whose time does not count again",
    ),
}
