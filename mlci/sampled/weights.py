"""What weighted samples tell, how surely, and whether to believe it.

Samples come in strata, the components of a mixture, each with a number of samples that is fixed;
so the variance of a sum is that within the strata.
"""

from __future__ import annotations

import numpy as np

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
