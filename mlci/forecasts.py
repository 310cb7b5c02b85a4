"""Phi as a forecast, and a map that makes it come true as often as it says.

Phi_i says how probable it is that an unconstrained agent crosses region i. Where demonstrations of
unconstrained agents are at hand, it can be judged like a forecast of rain: among the pairs of a
demonstration and a region that it gives 70 %, are 70 % crossed? `fit_map` finds a monotone map from
alpha = 1 - Phi to a calibrated alpha, from such pairs: beta calibration (Kull, Silva Filho and
Flach, AISTATS 2017) below a ceiling,

    P(crossed) = hi / (1 + exp(-(a + b log Phi + c L))),    L = -log alpha,  b, c >= 0.

b bends the map where a region is unlikely to be crossed, c where it is likely, and 1 - hi is the
share of demonstrators whom no forecast binds: the rate eta of `mlci.evidence`, measured. a = 0,
b = c = hi = 1 leave Phi as it is. A large region is harder to miss than a small one of the same
Phi, so regions of like size, up to twice the smallest, share a map, and others have their own.

Two promises hold whatever the demonstrations are:

* **Nothing comes from nothing.** Phi = 0, a region out of reach, stays 0. (A floor above 0 would
  add evidence for such a region with every demonstration.)
* **Nothing is certain.** n tasks in which whatever was forecast for certain came true do not show
  that it always will. A prior of one more task, in which it does not, leaves 1 / (n + 1) for that:
  hi <= 1 - 1 / (n + 1). So one demonstration brings at most -log(1 - hi) <= log(n + 1) nat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.optimize and scipy.special when they are first used
from numpy.typing import ArrayLike

from mlci.spaces import Bools, Floats, Ints

# Sums of probabilities over moves and steps are rounded by less; what is below is out of reach.
ROUNDED = 1e-12
_LIKE_SIZE = 2.0 + 1e-9  # largest size of a group, as a multiple of its smallest
_FEWEST_PAIRS = 50  # of a group, for a curve of its own
_LOWEST_CEILING = 0.05


@dataclass(frozen=True)
class ForecastCurve:
    """The map of regions of like size; see the head of this module.

    Attributes:
        sizes: smallest and largest size of the regions, as shares of the state space.
        tasks: n, the tasks that it was fitted on.
        pairs: of a task and a region that it was fitted on.
        intercept: a.
        of_probability: b.
        of_gain: c.
        ceiling: hi.

    Raises:
        ValueError: a curve that falls, or a ceiling that the number of tasks does not allow.
    """

    sizes: tuple[float, float]
    tasks: int
    pairs: int
    intercept: float
    of_probability: float
    of_gain: float
    ceiling: float

    def __post_init__(self) -> None:
        if self.of_probability < 0 or self.of_gain < 0:
            raise ValueError(f"a map of forecasts must not fall: {self}")
        if not 0 < self.ceiling <= 1 - 1 / (self.tasks + 1):
            raise ValueError(f"{self.tasks} tasks do not allow a ceiling of {self.ceiling}")

    @property
    def largest_gain(self) -> float:
        """What one demonstration brings at most [nat]."""
        return -math.log1p(-self.ceiling)

    def avoidance(self, avoidance: ArrayLike) -> Floats:
        """Calibrated alpha (...,), at least 1 - hi."""
        alpha = np.asarray(avoidance, dtype=float)
        parts = np.array([self.intercept, self.of_probability, self.of_gain])
        crossing = self.ceiling * scipy.special.expit(_features(alpha, self.tasks) @ parts)
        return np.where(is_possible(alpha), 1 - crossing, 1.0)


@dataclass(frozen=True)
class ForecastMap:
    """A monotone map from alpha to a calibrated alpha.

    Attributes:
        curves: one for each group of regions of like size, by size.
    """

    curves: tuple[ForecastCurve, ...]

    @property
    def largest_gain(self) -> float:
        """What one demonstration brings at most [nat]."""
        return max(curve.largest_gain for curve in self.curves)

    def curve_numbers(self, sizes: ArrayLike) -> Ints:
        """Which curve (C,) regions of some sizes (C,) use: the one whose sizes are nearest."""
        log_size = np.log(np.maximum(np.asarray(sizes, dtype=float), np.finfo(float).tiny))
        ends = np.log([curve.sizes for curve in self.curves])
        beyond = np.maximum(ends[:, 0] - log_size[:, None], log_size[:, None] - ends[:, 1])
        return np.argmin(np.maximum(beyond, 0.0), axis=1)

    def avoidance(self, avoidance: ArrayLike, sizes: ArrayLike) -> Floats:
        """Calibrated alpha (N, C); 1, for a region out of reach, stays 1.

        Args:
            avoidance: (N, C) alpha.
            sizes: (C,) sizes of the regions, see `mlci.region_sizes`.
        """
        alpha, numbers = np.array(avoidance, dtype=float), self.curve_numbers(sizes)
        for number, curve in enumerate(self.curves):
            alpha[:, numbers == number] = curve.avoidance(alpha[:, numbers == number])
        return alpha


def is_possible(avoidance: ArrayLike) -> Bools:
    """Which regions some trajectory crosses, by alpha: all but those that are out of reach."""
    return 1 - np.asarray(avoidance, dtype=float) > ROUNDED


def fit_map(
    avoidance: ArrayLike, violated: ArrayLike, sizes: ArrayLike, counts: ArrayLike | None = None
) -> ForecastMap:
    """The map with the best log score on demonstrations of unconstrained agents.

    A prior worth one task keeps the parameters finite: one more task goes as Phi says, its pairs
    being those of all tasks, each with a weight of 1 / n.

    Args:
        avoidance: (N, C) alpha.
        violated: (N, C) which regions each demonstration crosses.
        sizes: (C,) sizes of the regions.
        counts: (N, C) which pairs count. Leave out what is certain by a task's ends, since it never
            is evidence; what is out of reach is left out anyhow.

    Raises:
        ValueError: shapes that disagree, or no pair that counts.
    """
    alpha, crossed = checked_forecasts(avoidance, violated)
    use, size = is_possible(alpha), np.asarray(sizes, dtype=float)
    if size.shape != alpha.shape[1:]:
        raise ValueError(f"{alpha.shape[1]} regions need as many sizes, not {size.shape}")
    if counts is not None:
        use &= np.asarray(counts, dtype=bool)
    groups = _like_sizes(size, np.sum(use, axis=0))
    if not groups:
        raise ValueError("no pair of a demonstration and a region counts: nothing to fit")
    curves = []
    for low, high in groups:
        inside = use & (size >= low) & (size <= high)
        curves.append(_fit_curve(alpha[inside], crossed[inside], (low, high), len(alpha)))
    return ForecastMap(tuple(curves))


def _like_sizes(sizes: Floats, pairs: Ints) -> list[tuple[float, float]]:
    """Smallest and largest size of each group; a group with few pairs joins the one before it."""
    groups: list[list[float]] = []  # smallest size, largest size, pairs
    for size in np.unique(sizes[pairs > 0]).tolist():
        count = int(np.sum(pairs[sizes == size]))
        if groups and (size <= _LIKE_SIZE * groups[-1][0] or groups[-1][2] < _FEWEST_PAIRS):
            groups[-1] = [groups[-1][0], size, groups[-1][2] + count]
        else:
            groups.append([size, size, count])
    if len(groups) > 1 and groups[-1][2] < _FEWEST_PAIRS:
        last = groups.pop()
        groups[-1] = [groups[-1][0], last[1], groups[-1][2] + last[2]]
    return [(smallest, largest) for smallest, largest, _ in groups]


def _fit_curve(
    alpha: Floats, crossed: Bools, sizes: tuple[float, float], tasks: int
) -> ForecastCurve:
    """The curve with the best log score for some pairs (P,)."""
    features, highest = _features(alpha, tasks), 1 - 1 / (tasks + 1)
    share = (crossed + (1 - alpha) / tasks) / (1 + 1 / tasks)  # with the prior's task

    def loss(parts: Floats) -> tuple[float, Floats]:
        """Mean of minus the log score, and its gradient by a, b, c and hi."""
        rise, hi = scipy.special.expit(features @ parts[:3]), parts[3]
        crossing = np.maximum(hi * rise, np.finfo(float).tiny)
        of_pairs = -share * np.log(crossing) - (1 - share) * np.log1p(-crossing)
        slope = (1 - share) / (1 - crossing) - share / crossing
        by_curve = features.T @ (slope * hi * rise * (1 - rise))
        return np.mean(of_pairs), np.append(by_curve, slope @ rise) / len(share)

    bounds = [(None, None), (0, None), (0, None), (min(_LOWEST_CEILING, highest), highest)]
    # From below the highest ceiling, and from a lower one: the loss has a valley on either side.
    solutions = [
        scipy.optimize.minimize(
            loss,
            [0.0, 1.0, 1.0, ceiling * highest],
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
            options={"ftol": 1e-11, "gtol": 1e-7, "maxiter": 1000},
        )
        for ceiling in (1.0, 0.5)
    ]
    best = min(solutions, key=lambda solution: float(solution.fun))
    return ForecastCurve(sizes, tasks, len(alpha), *map(float, best.x))


def _features(alpha: Floats, tasks: int) -> Floats:
    """(..., 3) what a, b and c multiply: 1, log Phi, and L, which counts up to log(n + 1)."""
    gain = -np.log(np.maximum(alpha, 1 / (tasks + 1)))
    return np.stack([np.ones(alpha.shape), np.log(np.maximum(1 - alpha, ROUNDED)), gain], axis=-1)


def checked_forecasts(avoidance: ArrayLike, violated: ArrayLike) -> tuple[Floats, Bools]:
    """alpha (N, C) and D (N, C) as arrays.

    Raises:
        ValueError: shapes that disagree.
    """
    alpha, crossed = np.asarray(avoidance, dtype=float), np.asarray(violated, dtype=bool)
    if alpha.ndim != 2 or alpha.shape != crossed.shape:
        raise ValueError(
            f"forecasts need avoidance and violated (N, C), not {alpha.shape} and {crossed.shape}"
        )
    return alpha, crossed
