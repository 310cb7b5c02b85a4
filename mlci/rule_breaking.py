"""How often demonstrators ignore the constraint: the rate eps, by maximum marginal likelihood.

Demonstrations are e^(L_i(eps)) times as likely under constraint i as under none, where nobody has
anything to ignore (`mlci.evidence`). With the prior pi of `mlci.evidence.posterior`, they are

    M(eps) = pi_0 + sum_i pi_i e^(L_i(eps))

times as likely. The estimate of eps is where M is largest. Its interval reaches from the smallest
to the largest eps with 2 log(max M / M(eps)) <= q, where q is the quantile of chi^2 with one degree
of freedom: that of the likelihood ratio test. The rate eta of model error cannot be estimated so,
since the likelihood of every constraint is largest at eta = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, minimize_scalar
from scipy.special import logsumexp
from scipy.stats import chi2

from mlci.evidence import Rates, log_evidence, prior_shares, total_gain
from mlci.spaces import Floats, Ints

CONFIDENCE = 0.95
_MOST = 1 - 1e-6  # a rate is below 1
# M may have several peaks, one for each likely hypothesis; those that are wider than a fiftieth are
# told apart.
_GRID = np.concatenate([[0.0], np.geomspace(1e-6, 0.01, 9), np.linspace(0.02, 0.98, 49), [_MOST]])


@dataclass(frozen=True)
class RateEstimate:
    """A rate with its interval.

    Attributes:
        rate: the most likely one.
        lower: lower end of the 95 % interval.
        upper: upper end; 1 if the demonstrations do not tell.
    """

    rate: float
    lower: float
    upper: float

    def __str__(self) -> str:
        return f"{self.rate:.3g} ({self.lower:.3g} to {self.upper:.3g})"


def estimate_rule_breaking(
    avoidance: ArrayLike,
    violated: ArrayLike,
    model_error: float = 0.0,
    prior_none: float = 0.5,
    prior: ArrayLike | None = None,
) -> RateEstimate:
    """The rate eps that makes the demonstrations most likely, and its interval.

    Args:
        avoidance: (N, C) as of `mlci.evidence.log_evidence`.
        violated: (N, C) which hypotheses each demonstration violates.
        model_error: eta.
        prior_none: as of `mlci.evidence.posterior`.
        prior: likewise.

    Raises:
        ValueError: as of `log_evidence` and `posterior`.
    """
    # What is unavoidable has the gain of what is so but for rounding: finite, to be compared.
    alpha = np.maximum(avoidance, np.finfo(float).tiny)
    with np.errstate(divide="ignore"):
        log_prior = np.log(np.append(prior_shares(alpha.shape[-1], prior_none, prior), prior_none))

    def log_marginal(eps: float) -> float:
        rates = Rates(model_error, float(eps))
        gain = total_gain(log_evidence(alpha, violated, rates))
        return float(logsumexp(np.append(gain, 0.0) + log_prior))

    values = np.array([log_marginal(eps) for eps in _GRID])
    best = int(np.argmax(values))
    rate, highest = float(_GRID[best]), float(values[best])
    near = _GRID[max(best - 1, 0)], _GRID[min(best + 1, len(_GRID) - 1)]
    peak = minimize_scalar(lambda eps: -log_marginal(eps), bounds=near, method="bounded")
    if -peak.fun > highest:
        rate, highest = float(peak.x), float(-peak.fun)
    level = highest - chi2.ppf(CONFIDENCE, 1) / 2

    def crossing(outside: int, inside: float) -> float:
        """Where M passes the level between a rate of the grid and one that is above it."""
        return float(brentq(lambda eps: log_marginal(eps) - level, _GRID[outside], inside))

    above = np.flatnonzero(values >= level)
    first, last = (int(above[0]), int(above[-1])) if len(above) else (best, best)
    low, high = min(rate, float(_GRID[first])), max(rate, float(_GRID[last]))
    return RateEstimate(
        rate,
        crossing(int(np.searchsorted(_GRID, low)) - 1, low) if low > 0 else 0.0,
        crossing(int(np.searchsorted(_GRID, high, "right")), high) if high < _MOST else 1.0,
    )


def gains_of_subsets(
    avoidance: ArrayLike,
    violated: ArrayLike,
    subsets: Ints,
    model_error: float = 0.0,
    prior_none: float = 0.5,
) -> Floats:
    """Gains (B, C) [nat] of random subsets, each with the rate that makes it most likely.

    The rate is one of a grid whose steps are a fiftieth at most, which is as good for ranks as the
    estimate itself and far quicker for many subsets.

    Args:
        avoidance: (N, C) as of `estimate_rule_breaking`, and so on.
        violated: (N, C).
        subsets: (B, k) numbers of demonstrations.
        model_error: eta.
        prior_none: as of `mlci.evidence.posterior`.
    """
    alpha = np.maximum(avoidance, np.finfo(float).tiny)
    evidence = np.stack([log_evidence(alpha, violated, Rates(model_error, eps)) for eps in _GRID])
    share, none = np.log((1 - prior_none) / alpha.shape[-1]), np.log(prior_none)
    gains = []
    for subset in subsets:
        by_rate = total_gain(evidence[:, subset])
        marginal = np.logaddexp(logsumexp(by_rate, axis=-1) + share, none)
        gains.append(by_rate[np.argmax(marginal)])
    return np.array(gains)
