"""How often demonstrators ignore the constraint: the rate eps, by maximum marginal likelihood.

Demonstrations are e^(L_i(eps)) times as likely under constraint i as under none, where nobody has
anything to ignore (`mlci.evidence`). With the prior pi of `mlci.evidence.posterior`, they are

    M(eps) = pi_0 + sum_i pi_i e^(L_i(eps))

times as likely. The estimate of eps is where M is largest, with its interval
(`mlci.likelihood_interval`). The rate eta of model error cannot be estimated so, since the
likelihood of every constraint is largest at eta = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.evidence import Rates, log_evidence, log_marginal, total_gain
from mlci.likelihood_interval import likelihood_interval
from mlci.spaces import Floats, Ints

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

    def log_likelihood(eps: float) -> float:
        rates = Rates(model_error, float(eps))
        gain = total_gain(log_evidence(alpha, violated, rates))
        return float(log_marginal(gain, prior_none, prior))

    rate, lower, upper = likelihood_interval(log_likelihood, _GRID)
    return RateEstimate(rate, lower, 1.0 if upper == _MOST else upper)


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
    gains = []
    for subset in subsets:
        by_rate = total_gain(evidence[:, subset])
        gains.append(by_rate[np.argmax(log_marginal(by_rate, prior_none))])
    return np.array(gains)
