"""The methods of the benchmark: ours, the paper's as printed, and those of others.

A method is a function from a problem and a generator to an answer, and a line in `METHODS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from experiments.field.entries import Answer, Method
from mlci.evidence import (
    PAPER,
    Rates,
    log_evidence,
    posterior,
    printed_confidence,
    total_gain,
)
from mlci.rivals.penalty_map import penalty_map
from mlci.rivals.printed import printed_avoidance
from mlci.rivals.problem import Problem
from mlci.rivals.set_gains import set_gains, single_avoidance
from mlci.rivals.traces import crossings, density, nearest, visits
from mlci.rule_breaking import estimate_rule_breaking
from mlci.sets.evidence import SetGains
from mlci.sets.posterior import SetPosterior, SetPrior
from mlci.sets.sampling import sample_sets
from mlci.sets.search import search
from mlci.spaces import Floats

RATES = Rates(model_error=0.1)  # the default of `mlci.infer`
LEAST = 0.1  # [nat a demonstration], the stop of Scobee and Sastry
NEVER = 1e-100  # the model error of what has none: an infinite gain could not be sampled
STEPS = 100  # of each of two chains over sets, after half as many that do not count
PATHS = 100  # sampled in each task
ADJACENCY = 1.0  # [nat] for two neighbours; chosen on seeds 100 and 101, see README.md

Ask = Callable[[Problem, np.random.Generator], Answer]


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


def sets(problem: Problem, rng: np.random.Generator) -> Answer:
    """The posterior over sets of regions, neighbours the likelier together."""
    return _of_sets(_sampled(problem, set_gains(problem, _rates(problem)), rng))


def with_rates(problem: Problem, rng: np.random.Generator) -> Answer:
    """The same, with the rate of rule breaking that makes the demonstrations most likely."""
    singles = single_avoidance(problem)
    rates = _rates(problem)
    estimate = estimate_rule_breaking(singles, problem.violated, rates.model_error)
    rates = replace(rates, rule_breaking=min(estimate.rate, 0.5))
    return _of_sets(_sampled(problem, set_gains(problem, rates), rng))


def paper(problem: Problem, _rng: np.random.Generator) -> Answer:
    """The one region that explains most, from cell to cell; confidence (12) as it is printed."""
    alpha = printed_avoidance(problem)
    gains = total_gain(log_evidence(alpha, problem.violated, PAPER))
    first = int(np.argmax(gains))
    claimed = float(np.clip(printed_confidence(0.5, alpha[:, first]), 0.0, 1.0))
    return Answer(gains, np.arange(problem.regions) == first, claimed=claimed)


def bayesian(problem: Problem, rng: np.random.Generator) -> Answer:
    """Markov chains over all sets, each region forbidden with probability 1/2 by itself."""
    gains = set_gains(problem, Rates(NEVER), exact_ends=False)
    prior = SetPrior.independent(problem.regions, 0.0)
    return _of_sets(sample_sets(gains, prior, rng, chains=2, steps=STEPS))


def by_penalties(problem: Problem, _rng: np.random.Generator) -> Answer:
    """Penalties of maximum causal entropy inverse reinforcement learning."""
    penalties = penalty_map(problem)
    return Answer(np.where(problem.feasible, penalties, -np.inf))


def _rates(problem: Problem) -> Rates:
    """Of sets: none where paths follow the table's moves, else as of the study `areas`."""
    return Rates(NEVER if problem.shown[0].actions is not None else 0.01)


def _scorer(score: Callable[[Problem, np.random.Generator], Floats]) -> Ask:
    """A method that scores hypotheses, and excludes those that somebody violates."""
    return lambda problem, rng: Answer(np.where(problem.feasible, score(problem, rng), -np.inf))


def _sampled(problem: Problem, gains: SetGains, rng: np.random.Generator) -> SetPosterior:
    """Sets by a prior that expects about one region, neighbours of which are likelier."""
    count = problem.regions
    prior = SetPrior.independent(count, -float(np.log(count)), ADJACENCY, problem.neighbours)
    return sample_sets(gains, prior, rng, chains=2, steps=STEPS)


def _of_sets(sample: SetPosterior) -> Answer:
    """What is likelier forbidden than not."""
    marginal = sample.marginal
    return Answer(np.where(marginal > 0, marginal, -np.inf), marginal > 0.5, marginal)


METHODS = {
    "ours: single": Method(single, "this project: `mlci.infer`"),
    "ours: greedy": Method(
        greedy, "this project: `mlci.select_regions`, stop of Scobee and Sastry"
    ),
    "ours: sets": Method(sets, "this project: `mlci.infer_sets`"),
    "ours: with rates": Method(with_rates, "this project: sets, rate of rule breaking estimated"),
    "paper as printed": Method(
        paper, "Stocking, McPherson, Matthew, Tomlin: (4) to (6), and (12) as printed"
    ),
    "uniform": Method(_scorer(lambda problem, _: np.zeros(problem.regions)), "guessing"),
    "nearest unvisited": Method(_scorer(lambda problem, _: nearest(problem)), "a rule of thumb"),
    "visitation difference": Method(
        _scorer(lambda problem, _: visits(problem)), "Abbeel and Ng 2004; Ziebart et al. 2008"
    ),
    "sampled crossings": Method(
        _scorer(lambda problem, rng: crossings(problem, PATHS, rng)),
        "the paper's authors in later work: crossings of sampled unconstrained paths",
    ),
    "penalty map": Method(by_penalties, "Ziebart 2010, maximum causal entropy; L1 prior"),
    "Bayesian MCMC": Method(bayesian, "after Papadimitriou, Anwar and Brown 2022"),
    "one-class density": Method(
        _scorer(lambda problem, _: density(problem)), "after Elkan and Noto 2008"
    ),
}
