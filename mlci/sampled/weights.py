"""What weighted samples tell, how surely, and whether to believe it.

Samples come in strata, the components of a mixture, each with a number of samples that is fixed;
so the variance of a sum is that within the strata.
"""

from __future__ import annotations

import numpy as np

from mlci.sampling_errors import RESOLVED
from mlci.spaces import Floats, Ints

_SMALL = 10  # strata with fewer samples are taken together
_LEAST_TAIL = 5  # weights that a tail is judged by


def effective_count(log_weight: Floats) -> float:
    """(sum w)^2 / sum w^2: so many samples of one weight tell as much; 0 if all weights are."""
    if not np.any(log_weight > -np.inf):
        return 0.0
    weight = np.exp(log_weight - np.max(log_weight))
    return float(np.sum(weight) ** 2 / np.sum(np.square(weight)))


def deviations(values: Floats, strata: Ints) -> Floats:
    """Values (N, ...) less the mean of their stratum (N,), scaled to the variance of their sum.

    The sum of their squares estimates the variance of the sum of the values without bias.
    """
    count = np.bincount(strata)
    label = np.where(count[strata] < _SMALL, len(count), strata)
    _, label, size = np.unique(label, return_inverse=True, return_counts=True)
    begins = np.append(0, np.cumsum(size)[:-1])
    order = np.argsort(label, kind="stable")
    means = np.add.reduceat(values[order], begins, axis=0).T / size
    scale = np.sqrt(size / np.maximum(size - 1, 1))
    return np.asarray(((values.T - means.T[label].T) * scale[label]).T)


def pareto_shape(log_weight: Floats) -> float:
    """k of the generalised Pareto distribution that fits the largest weights.

    Above 0.7 sums over the samples cannot be believed whatever their number (Vehtari, Simpson,
    Gelman, Yao and Gabry 2024, "Pareto smoothed importance sampling"); the fit is that of Zhang and
    Stephens 2009. inf where there are too few weights above 0.
    """
    finite = np.sort(log_weight[log_weight > -np.inf])
    tail = int(min(len(log_weight) / 5, 3 * np.sqrt(len(log_weight))))
    if len(finite) <= tail or tail < _LEAST_TAIL:
        return np.inf
    weight = np.exp(finite[-tail - 1 :] - finite[-1])
    excess = weight[1:] - weight[0]
    if not excess[-1] > 0:
        return -np.inf  # all the same
    grid = np.arange(1, 31 + int(np.sqrt(tail)))
    quarter = excess[max(0, int(tail / 4 + 0.5) - 1)]
    quarter = quarter if quarter > 0 else np.min(excess[excess > 0])
    theta = 1 / excess[-1] + (1 - np.sqrt(len(grid) / (grid - 0.5))) / (3 * quarter)
    shape = np.mean(np.log1p(-theta[:, None] * excess), axis=1)
    log_likelihood = tail * (np.log(-theta / shape) - shape - 1)
    belief = np.exp(log_likelihood - np.max(log_likelihood))
    best = float(np.sum(theta * belief) / np.sum(belief))
    fitted = float(np.mean(np.log1p(-best * excess)))
    return (fitted * tail + 5.0) / (tail + 10)  # their weak prior towards 0.5


def sum_error(influences: Floats) -> Floats:
    """Standard errors (...,) of sums by how far each sample moves them (N, ...)."""
    return np.asarray(np.sqrt(np.sum(np.square(influences), axis=0)))


def replicates(
    chance: Floats,
    errors: Floats,
    influences: Floats,
    least: float,
    count: int,
    rng: np.random.Generator,
) -> Floats:
    """(count, C) probabilities as other samples might give them, in (0, 1].

    They are normal about the estimates; those near to 0 or 1 follow a gamma distribution, which is
    never negative, nor 0 for what no sample showed.

    Args:
        chance: (C,) estimates.
        errors: (C,) their standard errors, above 0.
        influences: (N, C) how far each sample moves them.
        least: takes the place of an estimate of 0.
        count: of replicates.
        rng: draws them.
    """
    moved = chance + rng.standard_normal((count, len(influences))) @ influences
    for is_small, near in ((True, chance), (False, 1 - chance)):
        rare = near < RESOLVED * errors
        mean, error = np.maximum(near, least)[rare], errors[rare]
        drawn = rng.gamma(np.square(mean / error), np.square(error) / mean, (count, len(mean)))
        moved[:, rare] = drawn if is_small else 1 - drawn
    return np.asarray(np.clip(moved, np.finfo(float).tiny, 1.0))
