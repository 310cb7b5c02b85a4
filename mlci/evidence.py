"""Evidence: from violation probabilities and violations to ranked constraints, (4)-(6) and (12).

Adding constraint i multiplies the likelihood of the demonstrations by prod_j 1 / (1 - Phi_i^j),
one factor a demonstration (each has its own start and goal, and so its own Z), or by 0 if any of
them violates i. The log of that factor is the gain L_i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import logsumexp

from mlci.spaces import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class Ranking:
    """Constraint hypotheses ranked by likelihood.

    Attributes:
        gain: (C,) L_i = -sum_j log(1 - Phi_i^j) [nat]. +inf if some tabular demonstration cannot
            avoid i; -inf if i is not feasible.
        feasible: (C,) whether no demonstration violates i.
        rank: (C,) 1 is most likely. Ties share the mean of their ranks, so that a hypothesis that
            explains nothing is not flattered by all the others that explain nothing; those that
            are not feasible tie in the last places.
        order: (C,) indices by rank, ties by index.
        posterior: (C,) probability of each being the one constraint.
        posterior_none: probability that there is none.
    """

    gain: Floats
    feasible: Bools
    rank: Floats
    order: Ints
    posterior: Floats
    posterior_none: float


def log_likelihood_gain(phi: ArrayLike) -> Floats:
    """-log(1 - Phi) (..., C) [nat] of each demonstration: the terms of L_i, equation (6)."""
    with np.errstate(divide="ignore"):
        return -np.log1p(-np.asarray(phi, dtype=float))


def rank_scores(gain: ArrayLike, feasible: ArrayLike) -> Floats:
    """Ranks (..., C), 1 for the largest gain; ties share their mean rank, infeasible ones last."""
    loss = -np.where(feasible, gain, -np.inf)
    rank = np.empty(loss.shape)
    for row in np.ndindex(loss.shape[:-1]):
        ordered = np.sort(loss[row])
        better = np.searchsorted(ordered, loss[row], side="left")
        up_to_ties = np.searchsorted(ordered, loss[row], side="right")
        rank[row] = (better + 1 + up_to_ties) / 2
    return rank


def rank_constraints(
    phi: ArrayLike,
    violated: ArrayLike,
    prior_none: float = 0.5,
    prior: ArrayLike | None = None,
) -> Ranking:
    """Rank the hypotheses, equations (4) to (6).

    Args:
        phi: (N', C) violation probabilities without the constraint, one row for each
            demonstration whose goal the tabular MDP can reach.
        violated: (N, C) which hypotheses each demonstration violates; those that the tabular MDP
            cannot follow refute hypotheses all the same.
        prior_none: prior probability that there is no constraint.
        prior: (C,) prior weights of the hypotheses; equal by default.

    Raises:
        ValueError: shapes that disagree, probabilities outside [0, 1].
    """
    phi, violated = np.asarray(phi, dtype=float), np.asarray(violated, dtype=bool)
    if phi.ndim != 2 or violated.ndim != 2 or phi.shape[1] != violated.shape[1]:
        raise ValueError(f"phi and violated need (N, C) each, not {phi.shape}, {violated.shape}")
    if not np.all((phi >= 0) & (phi <= 1)):
        raise ValueError("violation probabilities must lie in [0, 1]")
    feasible = ~np.any(violated, axis=0)
    gain = np.where(feasible, np.sum(log_likelihood_gain(phi), axis=0), -np.inf)
    rank = rank_scores(gain, feasible)
    each, none = posterior(gain, prior_none, prior)
    return Ranking(gain, feasible, rank, np.argsort(rank, kind="stable"), each, none)


def posterior(
    gain: ArrayLike, prior_none: float = 0.5, prior: ArrayLike | None = None
) -> tuple[Floats, float]:
    """Exact posterior under "at most one constraint", replacing (12) where MLCI chose among C.

    P(C_i | D) = pi_i e^(L_i) / (pi_0 + sum_k pi_k e^(L_k)), and e^(-inf) = 0 for the infeasible.
    An infinite gain takes all the probability; several share it by their priors.

    Args:
        gain: (C,) L_i, -inf where infeasible.
        prior_none: pi_0, in (0, 1].
        prior: (C,) weights of the hypotheses, scaled to add up to 1 - pi_0; equal by default.

    Returns:
        (C,) P(C_i | D), and P(no constraint | D).

    Raises:
        ValueError: a prior outside its range.
    """
    gain = np.asarray(gain, dtype=float)
    weights = np.ones(gain.shape) if prior is None else np.asarray(prior, dtype=float)
    if not 0 < prior_none <= 1:
        raise ValueError(f"the prior of no constraint must lie in (0, 1], not {prior_none}")
    if weights.shape != gain.shape or np.any(weights < 0) or not np.sum(weights) > 0:
        raise ValueError(f"the prior needs {gain.shape} weights >= 0 that are not all 0")
    share = (1 - prior_none) * weights / np.sum(weights)
    certain = (gain == np.inf) & (share > 0)
    if np.any(certain):
        return np.where(certain, share, 0.0) / np.sum(share[certain]), 0.0
    with np.errstate(divide="ignore"):
        log_weight = np.append(np.log(share) + gain, np.log(prior_none))
    probability = np.exp(log_weight - logsumexp(log_weight))
    return probability[:-1], float(probability[-1])


def confidence(prior: float, phi: ArrayLike) -> float:
    """(12), corrected: P(C | A_N) = p / (p + (1 - p) prod_j (1 - Phi^j)).

    For one hypothesis that was fixed before the demonstrations were seen, and that none of them
    violates; the best of many needs `posterior`.

    Args:
        prior: p, the probability that the constraint is there.
        phi: (N,) its violation probability for each demonstration.
    """
    if not 0 <= prior <= 1:
        raise ValueError(f"a prior probability lies in [0, 1], not {prior}")
    if prior == 0:
        return 0.0
    coincidence = float(np.exp(-np.sum(log_likelihood_gain(phi))))
    return prior / (prior + (1 - prior) * coincidence)


def printed_confidence(prior: float, phi: ArrayLike) -> float:
    """(12) as it is printed: p / (p - (1 - p) prod_j (1 - Phi^j)); wrong, for comparison only.

    It exceeds 1 wherever it is positive, grows without bound as the product comes near p / (1 - p),
    and is negative beyond. `confidence` is what must be meant.

    Args:
        prior: p, the probability that the constraint is there.
        phi: (N,) its violation probability for each demonstration.

    Returns:
        What the formula gives; infinite where it divides by 0.
    """
    if not 0 <= prior <= 1:
        raise ValueError(f"a prior probability lies in [0, 1], not {prior}")
    coincidence = float(np.exp(-np.sum(log_likelihood_gain(phi))))
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.float64(prior) / (prior - (1 - prior) * coincidence))
