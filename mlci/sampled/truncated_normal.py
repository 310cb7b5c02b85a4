"""Standard normal numbers between two bounds, by logarithms, which do not vanish in the tails.

Bounds above 0 are mirrored, where the distribution function would round to 1.
"""

from __future__ import annotations

import numpy as np
import scipy  # loads scipy.special when it is first used

from mlci.spaces import Bools, Floats


def quantile(low: Floats, high: Floats, share: Floats) -> Floats:
    """The numbers (...,) below which a share (...,) of those between low and high (...,) lies."""
    flip, log_below, log_between = _below_and_between(low, high)
    share = np.where(flip, 1 - share, share)
    with np.errstate(divide="ignore"):
        number = scipy.special.ndtri_exp(np.logaddexp(log_below, np.log(share) + log_between))
    return np.clip(np.where(flip, -number, number), low, high)


def log_mass(low: Floats, high: Floats) -> Floats:
    """Log probability (...,) of a number between low and high (...,)."""
    return _below_and_between(low, high)[2]


def mean_and_variance(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Of the numbers between low and high (...,)."""
    mass = log_mass(low, high)
    at_low, at_high = (
        np.exp(-np.square(bound) / 2 - np.log(2 * np.pi) / 2 - mass) for bound in (low, high)
    )
    with np.errstate(invalid="ignore"):  # an infinite bound has no density
        slope = np.where(np.isinf(low), 0.0, low * at_low)
        slope = slope - np.where(np.isinf(high), 0.0, high * at_high)
    mean = at_low - at_high
    return mean, np.clip(1 + slope - np.square(mean), 0.0, 1.0)


def _below_and_between(low: Floats, high: Floats) -> tuple[Bools, Floats, Floats]:
    """Which bounds are mirrored, and log probabilities of numbers below them and between them."""
    flip = low > 0
    least, most = np.where(flip, -high, low), np.where(flip, -low, high)
    log_below, log_most = scipy.special.log_ndtr(least), scipy.special.log_ndtr(most)
    return flip, log_below, log_most + np.log1p(-np.exp(log_below - log_most))
