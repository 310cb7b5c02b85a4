"""Whether Markov chains agree, and how much they are worth: R-hat and effective samples.

After Gelman et al., Bayesian Data Analysis, third edition, section 11.4 to 11.5: each chain is cut
in two halves, W is the mean variance within a half and B / n that between means of halves;

    R-hat = sqrt(((n - 1) / n W + B / n) / W),    n_eff = M n / (1 + 2 sum of rho_t),

with autocorrelations rho_t of all chains together, summed by pairs as long as these are positive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.spaces import Floats

AGREE = 1.05  # R-hat above which chains do not agree


@dataclass(frozen=True, eq=False)
class ChainCheck:
    """How far quantities (Q,) from chains can be trusted.

    Attributes:
        r_hat: (Q,) near 1 where chains agree; inf where each is stuck in a value of its own.
        effective: (Q,) number of independent samples that would be worth as much.
        standard_error: (Q,) of their means.
        accepted: share of the moves that were accepted.
    """

    r_hat: Floats
    effective: Floats
    standard_error: Floats
    accepted: float

    @classmethod
    def of(cls, draws: Floats, accepted: float) -> ChainCheck:
        """That of draws (M, T, Q): T of each of M chains."""
        effective = effective_samples(draws)
        deviation = np.std(draws.reshape(-1, draws.shape[2]), axis=0)
        return cls(split_r_hat(draws), effective, deviation / np.sqrt(effective), accepted)

    @property
    def agrees(self) -> bool:
        """Whether all chains tell the same."""
        return bool(np.max(self.r_hat, initial=1.0) <= AGREE)

    def __str__(self) -> str:
        worst = float(np.max(self.r_hat, initial=1.0))
        return (
            f"chains {'agree' if self.agrees else 'DISAGREE'} (R-hat {worst:.3f}), worth at least "
            f"{np.min(self.effective, initial=np.inf):.0f} samples"
        )


def split_r_hat(draws: Floats) -> Floats:
    """R-hat (Q,) of draws (M, T, Q), each chain cut in two; 1 for what never changes."""
    half = draws.shape[1] // 2
    halves = np.concatenate([draws[:, :half], draws[:, -half:]])
    within = np.mean(np.var(halves, axis=1, ddof=1), axis=0)
    between = np.var(np.mean(halves, axis=1), axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt((half - 1) / half + between / within)
    return np.where(between > 0, np.where(within > 0, ratio, np.inf), 1.0)


def effective_samples(draws: Floats) -> Floats:
    """(Q,) independent samples that draws (M, T, Q) are worth; at most M T."""
    chains, steps, _ = draws.shape
    centred = draws - np.mean(draws, axis=1, keepdims=True)
    spectrum = np.fft.rfft(centred, 2 * steps, axis=1)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, 2 * steps, axis=1)[:, :steps] / steps
    within = np.mean(covariance[:, 0], axis=0) * steps / (steps - 1)
    between = np.var(np.mean(draws, axis=1), axis=0, ddof=1) if chains > 1 else 0.0
    total = within * (steps - 1) / steps + between
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = 1 - (within - np.mean(covariance, axis=0)) / total  # (T, Q)
    pairs = correlation[: steps // 2 * 2].reshape(steps // 2, 2, -1).sum(axis=1)
    positive = np.cumprod(pairs > 0, axis=0)
    length = -1 + 2 * np.sum(pairs * positive, axis=0)
    effective = chains * steps / np.maximum(length, 1.0)
    return np.where(total > 0, effective, float(chains * steps))
