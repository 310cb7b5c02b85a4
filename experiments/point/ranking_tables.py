"""Tables of ranked hypotheses, and of the truth's rank over random subsets of demonstrations."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.special import expit, logit

from experiments.config.settings import Settings
from experiments.point.truth_tables import region_table
from mlci.best_areas import area_scores
from mlci.credible_sets import neighbours
from mlci.evidence import prior_shares, rank_scores, total_gain
from mlci.inference import UNAVOIDABLE, Inference
from mlci.metrics import claims, random_subsets, top_chances, truth_ranks
from mlci.planes import planes
from mlci.region_sizes import weights_by_size
from mlci.rule_breaking import gains_of_subsets
from mlci.spaces import Floats, Ints

BEST = (1, 2)  # so many of the best hypotheses are compared with the truth, as in Fig. 7


def rank_table(settings: Settings, inference: Inference, rng: np.random.Generator) -> pd.DataFrame:
    """A row a random subset of the demonstrations: where the truth is in the ranking after them.

    Beside the rank of the truth, if there is one, its columns are shares: whether that rank is
    among the first, and whether the best hypothesis, or both of the best two, overlap the truth
    or lie inside it, and of the most probable area whether it overlaps the truth, the share of its
    regions that do, and the share of all regions that it takes; `claim` is the posterior
    probability of the best.
    """
    hypotheses, constraint = inference.hypotheses, settings.constraint
    truth = hypotheses.inside(constraint)
    good = {"overlap": hypotheses.overlaps(constraint), "inside": truth}
    compared = [top for top in BEST if top <= len(hypotheses)] if len(constraint) else []
    ranks, touching = settings.ranks, neighbours(hypotheses)
    sizes = random_subsets(len(inference.names), ranks.demonstrations, ranks.subsets, rng)
    gains = np.concatenate([_gains(inference, subsets) for subsets in sizes])
    places = rank_scores(gains, gains > -np.inf)
    rank = truth_ranks(places, truth)
    area = vars(area_scores(gains, touching, good["overlap"]))
    reachable = [np.sum(inference.reachable[subsets], axis=1) for subsets in sizes]
    return pd.DataFrame(
        {
            "demonstrations": np.repeat(1 + np.arange(len(sizes)), ranks.subsets),
            "subset": np.tile(np.arange(ranks.subsets), len(sizes)),
            "reachable": np.concatenate(reachable),
            "rank": rank,
            f"share_top_{ranks.top}": (rank <= ranks.top).astype(int) if truth.any() else np.nan,
            **{
                f"top_{top}_{name}": top_chances(places, which, top) if top in compared else np.nan
                for name, which in good.items()
                for top in BEST
            },
            **{f"area_{name}": values if compared else np.nan for name, values in area.items()},
            "claim": claims(gains, inference.prior_none),
        }
    )


def _gains(inference: Inference, subsets: Ints) -> Floats:
    """Gains (B, C) of subsets (B, k); a rate of rule breaking that is estimated is so from each."""
    if inference.rule_breaking is None:
        return total_gain(inference.evidence[subsets])
    return gains_of_subsets(
        inference.forecast,
        inference.violated,
        subsets,
        inference.rates.model_error,
        inference.prior_none,
    )


def ranking_table(inference: Inference) -> pd.DataFrame:
    """A row a hypothesis: its box, outcome, gain, rank and probabilities.

    The gain of what is unavoidable is missing: it is infinite, as `outcome` says.
    `confidence_alone` is (12), whose product over demonstrations is e^-gain.
    """
    ranking, hypotheses = inference.ranking, inference.hypotheses
    weights = weights_by_size(hypotheses, inference.size_prior)
    prior = prior_shares(len(hypotheses), inference.prior_none, weights)
    return pd.DataFrame(
        {
            **region_table("hypothesis", hypotheses, planes(hypotheses)[0]),
            "feasible": ranking.feasible,
            "violating_demonstrations": np.sum(inference.violated, axis=0),
            "outcome": inference.outcomes,
            "gain": np.where(inference.outcomes == UNAVOIDABLE, np.nan, ranking.gain),
            "rank": ranking.rank,
            "posterior": ranking.posterior,
            "confidence_alone": expit(logit(prior) + ranking.gain),
        }
    )
