"""A fitted rule: the probability of success by a few numbers, and how well it foretells.

Logistic regression: p = 1 / (1 + e^-(b + w z)) with z the features less their means, in units of
their standard deviations. Weights are found by Newton's steps on the log likelihood less a ridge
|w|^2 / 2, the logarithm of a standard normal prior of each weight, which keeps them finite where
success is separable (Hoerl and Kennard 1970; Le Cessie and van Houwelingen 1992).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # loads scipy.special when it is first used
from numpy.typing import ArrayLike, NDArray

from mlci.spaces import Floats

_RIDGE = 1.0
_STEPS = 50
_SETTLED = 1e-10


@dataclass(frozen=True, eq=False)
class Rule:
    """A fitted logistic regression.

    Attributes:
        mean: (F,) of the features where it was fitted.
        scale: (F,) their standard deviations there, 1 where all are equal.
        weights: (F,) log odds of success a standard deviation.
        intercept: log odds of success at the mean.
    """

    mean: Floats
    scale: Floats
    weights: Floats
    intercept: float

    def probability(self, features: ArrayLike) -> Floats:
        """(...,) probability of success by features (..., F)."""
        z = (np.asarray(features, dtype=float) - self.mean) / self.scale
        return np.asarray(scipy.special.expit(self.intercept + z @ self.weights))


def fit_rule(features: ArrayLike, success: ArrayLike, ridge: float = _RIDGE) -> Rule:
    """Fit a rule to cases.

    Args:
        features: (B, F) numbers of each case.
        success: (B,) whether it succeeded, or the share of its trials that did.
        ridge: what a squared weight costs [nat]; the intercept costs nothing.

    Raises:
        ValueError: no case, shapes that disagree, a value that is not finite, or so large that its
            spread is not, or a ridge below 0.
    """
    x, y = np.asarray(features, dtype=float), np.asarray(success, dtype=float)
    if x.ndim != 2 or y.shape != x.shape[:1] or not len(y):
        raise ValueError(f"features (B, F) and success (B,) do not agree: {x.shape}, {y.shape}")
    if not (np.all(np.isfinite(x)) and np.all((y >= 0) & (y <= 1))):
        raise ValueError("features must be finite, and success between 0 and 1")
    if not 0 <= ridge < np.inf:
        raise ValueError(f"a ridge is a finite price of at least 0, not {ridge}")
    with np.errstate(over="ignore", invalid="ignore"):
        mean, deviation = x.mean(axis=0), x.std(axis=0)
    if not np.all(np.isfinite(deviation)):
        raise ValueError(f"features are too large to be standardised: up to {np.max(np.abs(x)):g}")
    scale = np.where(deviation > 0, deviation, 1.0)
    z = np.column_stack([np.ones(len(y)), (x - mean) / scale])
    price = np.diag([1e-6, *[ridge] * x.shape[1]])  # a hair: all may have succeeded
    weights = np.zeros(z.shape[1])
    for _ in range(_STEPS):
        p = scipy.special.expit(z @ weights)
        curvature = (z * (p * (1 - p))[:, None]).T @ z + price
        step = np.linalg.solve(curvature, z.T @ (y - p) - price @ weights)
        weights = weights + step * min(1.0, 2.0 / np.max(np.abs(step)))
        if np.max(np.abs(step)) < _SETTLED:
            break
    return Rule(mean, scale, weights[1:], float(weights[0]))


def left_out(features: Floats, success: Floats, groups: ArrayLike) -> Floats:
    """(B,) probability of success of each case by a rule that was fitted without its group.

    Raises:
        ValueError: groups that are not (B,), or a single one, which leaves no case to fit; or as of
            `fit_rule`.
    """
    groups = _several_groups(groups, len(success))
    probability = np.empty(len(success))
    for group in np.unique(groups):
        out = groups == group
        probability[out] = fit_rule(features[~out], success[~out]).probability(features[out])
    return probability


def brier_scores(probability: ArrayLike, success: ArrayLike) -> Floats:
    """(B,) mean squared difference of a forecast from what came of a case's trials.

    With a share y of successes it is (p - y)^2 + y (1 - y); the second part no forecast can avoid.
    """
    p, y = np.asarray(probability, dtype=float), np.asarray(success, dtype=float)
    return np.asarray((p - y) ** 2 + y * (1 - y))


def choose_features(
    features: Floats,
    success: Floats,
    groups: ArrayLike,
    most: int,
    first: Sequence[int] = (),
    least: float = 0.01,
) -> list[int]:
    """Features that foretell success in groups that were left out, the most telling first.

    Each is the one that, beside those before it, lowers the Brier score of `left_out` most; the
    choice ends where none lowers it by `least`. The score of the choice itself is then too good:
    judge it in groups that had no part in it, see `left_out_choice`.

    Args:
        features: (B, F) numbers of each case.
        success: (B,) share of a case's trials that succeeded.
        groups: (B,) what is left out at a time, such as the system; of one alone none is chosen.
        most: features, at most.
        first: features that are taken in any case.
        least: by which a further feature must lower the score.
    """
    chosen = list(first)
    if len(np.unique(np.asarray(groups))) < 2:
        return chosen  # no group can be left out
    best = float(np.mean(brier_scores(left_out(features[:, chosen], success, groups), success)))
    while len(chosen) < most:
        scores = {
            f: np.mean(brier_scores(left_out(features[:, [*chosen, f]], success, groups), success))
            for f in range(features.shape[1])
            if f not in chosen
        }
        if not scores or min(scores.values()) > best - least:
            break
        best_feature = min(scores, key=lambda f: float(scores[f]))
        chosen.append(best_feature)
        best = float(scores[best_feature])
    return chosen


def left_out_choice(
    features: Floats, success: Floats, groups: ArrayLike, most: int, first: Sequence[int] = ()
) -> Floats:
    """(B,) as `left_out`, where features are chosen anew without the group that is foretold."""
    groups = _several_groups(groups, len(success))
    probability = np.empty(len(success))
    for group in np.unique(groups):
        out = groups == group
        chosen = choose_features(features[~out], success[~out], groups[~out], most, first)
        rule = fit_rule(features[~out][:, chosen], success[~out])
        probability[out] = rule.probability(features[out][:, chosen])
    return probability


def _several_groups(groups: ArrayLike, cases: int) -> NDArray[Any]:
    """Groups (B,) of which one can be left out."""
    labels = np.asarray(groups)
    if labels.shape != (cases,) or len(np.unique(labels)) < 2:
        raise ValueError(
            f"{cases} cases need a group each, of two or more, not {labels.shape} of "
            f"{len(np.unique(labels))}"
        )
    return labels
