"""Does a recorded path move as the dynamics allow, under any control in range?

Over short windows the path's mean rate r is compared with the mean of h(x, u) = f(x) + G(x) u along
it, with the best u in the control box. What is left over, r - h, shows wrong units (an angle in
degrees moves 57.3 times faster than its velocity says), wrong columns and wrong times. Means over
windows leave room for noise, and for recordings that were integrated by explicit Euler steps: these
move as the beginning of each step says, half a sample behind the trapezoidal mean taken here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.recordings.noise import noise
from mlci.spaces import Floats
from mlci.systems import System

_WINDOWS = 50  # of a path, at most
_SWEEPS = 30  # of coordinate descent over the controls; one is exact for a single control
_SHARE = 0.3  # of the rate: a median residual beyond it is no motion of the system
_MOVES = 0.05  # of the bounds, that the residual must add up to over the whole path


@dataclass(frozen=True, eq=False)
class Motion:
    """How a path's rates compare with those that the dynamics allow.

    Attributes:
        rates: (W, n) mean rates over W windows [unit of x / s].
        residuals: (W, n) what no control in range explains of them.
        noise: (n,) how much of a rate may be noise of the samples.
        driven: (n,) whether a control acts on a dimension.
        duration: of the path [s].
    """

    rates: Floats
    residuals: Floats
    noise: Floats
    driven: np.ndarray
    duration: float

    @property
    def median(self) -> Floats:
        """(n,) median residual [unit of x / s]."""
        return np.asarray(np.median(np.abs(self.residuals), axis=0))

    @property
    def worst(self) -> Floats:
        """(n,) largest residual [unit of x / s]."""
        return np.asarray(np.max(np.abs(self.residuals), axis=0))

    @property
    def factor(self) -> Floats:
        """(n,) how many times faster a dimension moves than the dynamics allow; NaN if unclear."""
        allowed, rates = np.abs(self.rates - self.residuals), np.abs(self.rates)
        factors = np.full(rates.shape[1], np.nan)
        for d, (given, seen) in enumerate(zip(allowed.T, rates.T, strict=True)):
            fast = given > np.median(given) if np.any(given > np.median(given)) else given > 0
            if fast.any():
                low, factors[d], high = np.quantile(seen[fast] / given[fast], [0.25, 0.5, 0.75])
                if high > 1.5 * low:
                    factors[d] = np.nan
        return factors

    def unlike(self, widths: Floats) -> np.ndarray:
        """(n,) which dimensions move unlike the dynamics; widths (n,) are those of the bounds."""
        allowed = np.median(np.abs(self.rates - self.residuals), axis=0)
        usual = np.maximum(np.median(np.abs(self.rates), axis=0), allowed)
        far = self.median > _SHARE * usual + 2 * self.noise
        return np.asarray(far & (self.median * self.duration > _MOVES * widths))


def motion(system: System, path: Floats, time: Floats) -> Motion:
    """Compare a path's motion with the dynamics.

    Args:
        system: the dynamics and the control box.
        path: (K+1, n) without jumps in periodic dimensions.
        time: (K+1,) of the samples [s], rising.
    """
    starts = np.searchsorted(time, np.linspace(time[0], time[-1], _WINDOWS + 1)[:-1])
    edges = np.append(np.unique(starts), len(time) - 1)
    edges = np.unique(edges)
    lasts = np.diff(time[edges])[:, None]
    rates = np.diff(path[edges], axis=0) / lasts
    drift, gains = _affine(system, path)

    def mean(values: Floats) -> Floats:
        """Means over the windows of values (K+1, ...) at the samples, by the trapezoidal rule."""
        flat = values.reshape(len(values), -1)
        parts = (flat[1:] + flat[:-1]) / 2 * np.diff(time)[:, None]
        sums = np.add.reduceat(parts, edges[:-1], axis=0) / lasts
        return sums.reshape(len(lasts), *values.shape[1:])

    drift, gains = mean(drift), mean(gains)
    left = _least_residuals(rates - drift, gains, system)
    spread = noise(path, time) * np.sqrt(2) / np.median(lasts)
    driven = np.any(gains != 0, axis=(0, 2))
    return Motion(rates, left, spread, driven, float(time[-1] - time[0]))


def _affine(system: System, path: Floats) -> tuple[Floats, Floats]:
    """h at the middle of the control box (K+1, n), and its change over half the box (K+1, n, m)."""
    box = system.control_box
    middle = (box.lower + box.upper) / 2
    drift = system.dynamics(path, np.broadcast_to(middle, (len(path), len(middle))))
    gains = np.zeros((*drift.shape, len(middle)))
    for i in range(len(middle)):
        ends = [
            system.dynamics(
                path,
                np.broadcast_to(
                    np.where(np.arange(len(middle)) == i, end, middle), (len(path), len(middle))
                ),
            )
            for end in (box.lower, box.upper)
        ]
        gains[..., i] = (ends[1] - ends[0]) / 2
    return drift, gains


def _least_residuals(left: Floats, gains: Floats, system: System) -> Floats:
    """left - gains u (W, n) for the best u in [-1, 1]^m, in shares of the bounds' widths."""
    weights = 1 / system.space.bounds.widths**2
    squares = np.einsum("wni,n->wi", gains**2, weights)
    controls = np.zeros(squares.shape)
    for _ in range(_SWEEPS if controls.shape[1] > 1 else 1):
        for i in range(controls.shape[1]):
            others = (
                left
                - np.einsum("wnj,wj->wn", gains, controls)
                + gains[..., i] * controls[:, i : i + 1]
            )
            pull = np.einsum("wn,n->w", gains[..., i] * others, weights)
            with np.errstate(divide="ignore", invalid="ignore"):
                best = np.where(squares[:, i] > 0, pull / squares[:, i], 0.0)
            controls[:, i] = np.clip(best, -1, 1)
    return left - np.einsum("wnj,wj->wn", gains, controls)
