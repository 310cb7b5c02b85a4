"""The methods of others, and the paper's as printed.

A method is a function from a problem and a generator to an answer, and a line in `METHODS`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from experiments.field.entries import Answer, Method
from mlci.evidence import PAPER, Rates, log_evidence, printed_confidence, total_gain
from mlci.rivals.penalty_map import penalty_map
from mlci.rivals.printed import printed_avoidance
from mlci.rivals.problem import Problem
from mlci.rivals.set_gains import set_gains
from mlci.rivals.traces import crossings, density, nearest, visits
from mlci.sets.posterior import SetPrior
from mlci.sets.sampling import sample_sets
from mlci.spaces import Floats

NEVER = 1e-100  # a model error too small to matter: an infinite gain could not be sampled
STEPS = 100  # of each of two chains over sets, after half as many that do not count
PATHS = 100  # sampled in each task

Ask = Callable[[Problem, np.random.Generator], Answer]


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
    marginal = sample_sets(gains, prior, rng, chains=2, steps=STEPS).marginal
    return Answer(np.where(marginal > 0, marginal, -np.inf), marginal > 0.5, marginal)


def by_penalties(problem: Problem, _rng: np.random.Generator) -> Answer:
    """Penalties of maximum causal entropy inverse reinforcement learning."""
    penalties = penalty_map(problem)
    return Answer(np.where(problem.feasible, penalties, -np.inf))


def _scorer(score: Callable[[Problem, np.random.Generator], Floats]) -> Ask:
    """A method that scores hypotheses, and excludes those that somebody violates."""
    return lambda problem, rng: Answer(np.where(problem.feasible, score(problem, rng), -np.inf))


METHODS = {
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
