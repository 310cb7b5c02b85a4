"""Evidence: from probabilities of avoiding and violations to ranked constraints, (4)-(6) and (12).

Adding constraint i multiplies the likelihood of a demonstration that avoids i by 1 / alpha_i, where
alpha_i = 1 - Phi_i is how probable it is that the unconstrained agent avoids i, and by 0 if the
demonstration violates i. Each demonstration has its own start and goal, and so its own Z and alpha:
the gain L_i is the sum of the logs.

Two rates say how far the demonstrator may be from that; both are 0 in the paper.

* **Model error** eta: with this probability a demonstration is of an agent whom the tabular model
  does not describe, and that it avoids i says nothing. Then P(avoids i | no constraint) is
  a_i = (1 - eta) alpha_i + eta, and one demonstration brings at most -log eta.
* **Rule breaking** eps: with this probability the demonstrator ignores the constraint. Under
  constraint i a demonstration xi then has the density (1 - eps) p(xi | xi avoids i) + eps p(xi),
  whose ratio to p(xi) is

      (1 - eps) [xi avoids i] / a_i + eps,

  so that a violation costs log eps, and does not exclude i for ever.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.special when it is first used
from numpy.typing import ArrayLike

from mlci.spaces import Bools, Floats, Ints


@dataclass(frozen=True)
class Rates:
    """How far demonstrators may be from the tabular model and from the constraint.

    Attributes:
        model_error: eta, share of demonstrations that say nothing by what they avoid.
        rule_breaking: eps, share of demonstrations that ignore the constraint.

    Raises:
        ValueError: a rate outside [0, 1).
    """

    model_error: float = 0.0
    rule_breaking: float = 0.0

    def __post_init__(self) -> None:
        for name, rate in vars(self).items():
            if not 0 <= rate < 1:
                raise ValueError(f"the rate {name} must lie in [0, 1), not {rate}")


PAPER = Rates()
DEFAULT_MODEL_ERROR = 0.1  # where no forecasts have been scored; the ratio itself favours 0

# See `decided_by_cell`. Below the first, the default model error leaves a pair within .01 nat of
# what certainty brings, so that 7 nat or 81 are no less certain than an exact 0. The second is ten
# times that, so that a pair whose probability only shifts with its ends is not one they decide.
_NEARLY_0, _NOT_0 = 1e-3, 1e-2

TIE = 1e-9  # nat: gains closer than this are equal, whatever order or machine summed them


@dataclass(frozen=True, eq=False)
class Ranking:
    """Constraint hypotheses ranked by likelihood.

    Attributes:
        gain: (C,) L_i [nat]: how much more likely the demonstrations are under constraint i. -inf
            for what a demonstration violates, if nobody breaks rules; +inf for what some tabular
            agent cannot avoid although its demonstration does, if the model has no error.
        feasible: (C,) whether no demonstration violates i.
        rank: (C,) 1 is most likely. Ties share the mean of their ranks, so that a hypothesis that
            explains nothing is not flattered by all the others that explain nothing; those that
            are impossible tie in the last places.
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


def log_evidence(avoidance: ArrayLike, violated: ArrayLike, rates: Rates = PAPER) -> Floats:
    """Log likelihood ratio (N, C) [nat] of constraint i against none: the terms of L_i in (6).

    Args:
        avoidance: (N, C) alpha, probability that the unconstrained agent avoids a region; 1 where
            a demonstration says nothing by avoiding it.
        violated: (N, C) which regions each demonstration violates.
        rates: model error and rule breaking.

    Raises:
        ValueError: shapes that disagree, or probabilities outside [0, 1].
    """
    alpha, crossed = np.asarray(avoidance, dtype=float), np.asarray(violated, dtype=bool)
    if alpha.ndim != 2 or alpha.shape != crossed.shape:
        raise ValueError(
            f"avoidance and violated need (N, C) each, not {alpha.shape} and {crossed.shape}"
        )
    if not np.all((alpha >= 0) & (alpha <= 1)):
        raise ValueError("probabilities of avoiding must lie in [0, 1]")
    eta, eps = rates.model_error, rates.rule_breaking
    with np.errstate(divide="ignore"):
        # log((1 - eps) / a + eps), without the overflow of 1 / a.
        of_avoiding = np.log((1 - eps) + eps * ((1 - eta) * alpha + eta)) - np.log(
            (1 - eta) * alpha + eta
        )
        return np.where(crossed, np.log(eps), of_avoiding)


def decided_by_cell(between_cells: ArrayLike, between_states: ArrayLike) -> Bools:
    """Which pairs (N, C) a cell decides: they are no evidence.

    The tabular agent is certain, or nearly certain, to enter a region if it begins and ends at the
    centres of cells, and can avoid it if it begins and ends where the demonstration does. That such
    a demonstration avoids the region says where it lies in its cell, and nothing of a constraint.

    Args:
        between_cells: (N, C) alpha of trajectories from cell to cell.
        between_states: (N, C) alpha of trajectories from state to state.
    """
    return (np.asarray(between_cells) < _NEARLY_0) & (np.asarray(between_states) > _NOT_0)


def total_gain(evidence: Floats) -> Floats:
    """L_i (..., C) of log evidence (..., N, C): its sum; -inf where a violation excludes i."""
    with np.errstate(invalid="ignore"):
        gain = np.sum(evidence, axis=-2)
    return np.where(np.any(evidence == -np.inf, axis=-2), -np.inf, gain)


def rank_scores(gain: ArrayLike, feasible: ArrayLike) -> Floats:
    """Ranks (..., C), 1 for the largest gain; ties share their mean rank, infeasible ones last.

    Gains tie if no neighbours between them, by size, are `TIE` apart.
    """
    loss = -np.where(feasible, gain, -np.inf)
    order, place = np.argsort(loss, axis=-1), np.arange(loss.shape[-1])
    ordered = np.take_along_axis(loss, order, axis=-1)
    with np.errstate(invalid="ignore"):  # infinite ones tie
        begins = np.diff(ordered, axis=-1, prepend=-np.inf) > TIE
        ends = np.diff(ordered, axis=-1, append=np.inf) > TIE
    first = np.maximum.accumulate(np.where(begins, place, 0), axis=-1)
    last = np.where(ends, place, loss.shape[-1] - 1)[..., ::-1]
    last = np.minimum.accumulate(last, axis=-1)[..., ::-1]
    rank = np.empty(loss.shape)
    np.put_along_axis(rank, order, (first + last) / 2 + 1, axis=-1)
    return rank


def rank_constraints(
    avoidance: ArrayLike,
    violated: ArrayLike,
    prior_none: float = 0.5,
    prior: ArrayLike | None = None,
    rates: Rates = PAPER,
) -> Ranking:
    """Rank the hypotheses, equations (4) to (6).

    Args:
        avoidance: (N, C) as of `log_evidence`.
        violated: (N, C) which hypotheses each demonstration violates.
        prior_none: prior probability that there is no constraint.
        prior: (C,) prior weights of hypotheses, which then count for rank; equal by default.
        rates: model error and rule breaking.

    Raises:
        ValueError: shapes that disagree, probabilities outside [0, 1].
    """
    return rank_evidence(log_evidence(avoidance, violated, rates), violated, prior_none, prior)


def rank_evidence(
    evidence: Floats, violated: ArrayLike, prior_none: float, prior: ArrayLike | None = None
) -> Ranking:
    """Rank the hypotheses by log evidence (N, C) [nat]; the rest is as of `rank_constraints`."""
    gain = score = total_gain(evidence)
    if prior is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            score = gain + np.log(prior_shares(gain.shape[-1], prior_none, prior))
    rank = rank_scores(score, gain > -np.inf)
    each, none = posterior(gain, prior_none, prior)
    feasible = ~np.any(np.asarray(violated, dtype=bool), axis=0)
    return Ranking(gain, feasible, rank, np.argsort(rank, kind="stable"), each, float(none))


def posterior(
    gain: ArrayLike, prior_none: float = 0.5, prior: ArrayLike | None = None
) -> tuple[Floats, Floats]:
    """Exact posterior under "at most one constraint", replacing (12) where MLCI chose among C.

    P(C_i | D) = pi_i e^(L_i) / (pi_0 + sum_k pi_k e^(L_k)), and e^(-inf) = 0 for the infeasible.
    An infinite gain takes all the probability; several share it by their priors.

    Args:
        gain: (..., C) L_i, -inf where infeasible.
        prior_none: pi_0, in (0, 1].
        prior: (C,) weights of the hypotheses, scaled to add up to 1 - pi_0; equal by default.

    Returns:
        (..., C) P(C_i | D), and (...,) P(no constraint | D).

    Raises:
        ValueError: a prior outside its range.
    """
    gain = np.asarray(gain, dtype=float)
    share = prior_shares(gain.shape[-1], prior_none, prior)
    certain = (gain == np.inf) & (share > 0)
    decided = np.any(certain, axis=-1, keepdims=True)
    gain = np.where(decided, np.where(certain, 0.0, -np.inf), gain)
    with np.errstate(divide="ignore"):
        none = np.where(decided, -np.inf, np.log(prior_none))
        log_weight = np.concatenate([np.log(share) + gain, none], axis=-1)
    probability = np.exp(log_weight - scipy.special.logsumexp(log_weight, axis=-1, keepdims=True))
    return probability[..., :-1], probability[..., -1]


def prior_shares(count: int, prior_none: float, prior: ArrayLike | None = None) -> Floats:
    """pi_i (C,), the prior probabilities of `count` hypotheses; arguments as of `posterior`.

    Raises:
        ValueError: a prior outside its range.
    """
    weights = np.ones(count) if prior is None else np.asarray(prior, dtype=float)
    if not 0 < prior_none <= 1:
        raise ValueError(f"the prior of no constraint must lie in (0, 1], not {prior_none}")
    if weights.shape != (count,) or np.any(weights < 0) or not np.sum(weights) > 0:
        raise ValueError(f"the prior needs ({count},) weights >= 0 that are not all 0")
    return (1 - prior_none) * weights / np.sum(weights)


def log_marginal(
    gain: ArrayLike, prior_none: float = 0.5, prior: ArrayLike | None = None
) -> Floats:
    """log(pi_0 + sum_i pi_i e^(L_i)) (...,): how likely demonstrations are, against none for sure.

    Args:
        gain: (..., C) L_i.
        prior_none: as of `posterior`.
        prior: likewise.

    Raises:
        ValueError: as of `posterior`.
    """
    gain = np.asarray(gain, dtype=float)
    shares = np.append(prior_shares(gain.shape[-1], prior_none, prior), prior_none)
    with np.errstate(divide="ignore"):
        log_prior = np.log(shares)
    none = np.zeros((*gain.shape[:-1], 1))
    return np.asarray(
        scipy.special.logsumexp(np.concatenate([gain, none], axis=-1) + log_prior, axis=-1)
    )


def confidence(prior: float, avoidance: ArrayLike) -> float:
    """(12), corrected: P(C | A_N) = p / (p + (1 - p) prod_j (1 - Phi^j)).

    For one hypothesis that was fixed before the demonstrations were seen, and that none of them
    violates; the best of many needs `posterior`.

    Args:
        prior: p, the probability that the constraint is there.
        avoidance: (N,) alpha = 1 - Phi, its probability of being avoided in each demonstration.
    """
    if not 0 <= prior <= 1:
        raise ValueError(f"a prior probability lies in [0, 1], not {prior}")
    if prior == 0:
        return 0.0
    coincidence = float(np.prod(np.asarray(avoidance, dtype=float)))
    return prior / (prior + (1 - prior) * coincidence)


def printed_confidence(prior: float, avoidance: ArrayLike) -> float:
    """(12) as it is printed: p / (p - (1 - p) prod_j (1 - Phi^j)); wrong, for comparison only.

    It exceeds 1 wherever it is positive, grows without bound as the product comes near p / (1 - p),
    and is negative beyond. `confidence` is what must be meant.

    Args:
        prior: p, the probability that the constraint is there.
        avoidance: (N,) alpha = 1 - Phi, its probability of being avoided in each demonstration.

    Returns:
        What the formula gives; infinite where it divides by 0, but for rounding.
    """
    if not 0 <= prior <= 1:
        raise ValueError(f"a prior probability lies in [0, 1], not {prior}")
    coincidence = float(np.prod(np.asarray(avoidance, dtype=float)))
    divisor = prior - (1 - prior) * coincidence
    if abs(divisor) <= TIE * prior:
        return np.inf if prior else np.nan
    return prior / divisor
