"""What demonstrations of a task may show, and how much is expected to be learnt from it.

What one learns from a demonstration is the vector D (C,) of the regions that it violates. Under
truth i, its agent is the unconstrained one on condition that it avoids i (`mlci.evidence`):

    P_i(D) = (1 - eps) P(D) [D_i = 0] / a_i + eps P(D),     P_none(D) = P(D).

So trajectories that are drawn once, without a constraint, serve all truths: one that avoids i
weighs 1 / a_i under i. With the posterior p, and P'(D) = sum_i p_i P_i(D) over all truths and none,
the expected drop of the posterior's entropy is the mutual information of truth and D,

    I = sum_i p_i sum_D P_i(D) log P_i(D) - sum_D P'(D) log P'(D).

Two things are done to the trajectories. Where forecasts are calibrated, or the model may err, they
cross regions as often as forecasts say (`as_forecast`). And truths that hardly any of them avoids
share one outcome, "something that was never drawn": nothing is known of how such demonstrations
differ, so that I errs on the low side.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # loads scipy.special when it is first used
from numpy.typing import ArrayLike

from mlci.evidence import PAPER, Rates
from mlci.spaces import Bools, Floats, Ints

_FEWEST = 10  # trajectories that must avoid a region for their share to tell its probability
_REVEALS = 0.1  # of the posterior: a demonstration that moves less of it reveals nothing


@dataclass(frozen=True, eq=False)
class TaskOutcomes:
    """What demonstrations of one task may show, and how probable that is under each truth.

    Attributes:
        likelihood: (O, C+1) probability of each outcome under each of C truths, and last under no
            constraint; columns add up to 1.
        samples: trajectories that it was estimated from.

    Raises:
        ValueError: columns that do not add up to 1.
    """

    likelihood: Floats
    samples: int

    def __post_init__(self) -> None:
        total = np.sum(self.likelihood, axis=0)
        if self.likelihood.ndim != 2 or not np.allclose(total, 1):
            raise ValueError(f"likelihoods (O, C+1) add up to 1 in each column, not to {total}")

    @cached_property
    def _certainty(self) -> Floats:
        """(C+1,) sum of P log P over the outcomes of each truth."""
        return np.asarray(np.sum(scipy.special.xlogy(self.likelihood, self.likelihood), axis=0))

    def information(self, beliefs: ArrayLike) -> Floats:
        """Expected drop of entropy (...,) [nat] of beliefs (..., C+1), the last of no constraint.

        It is 0 at least, and the belief's entropy at most.
        """
        belief = np.asarray(beliefs, dtype=float)
        outcome = belief @ self.likelihood.T
        gain = belief @ self._certainty - np.sum(scipy.special.xlogy(outcome, outcome), axis=-1)
        return np.maximum(gain, 0.0)

    def error(self, belief: Floats) -> float:
        """Standard error of `information` [nat] for a belief (C+1,), from its influence function.

        One more trajectory with outcome D would change it by sum_i p_i P_i(D) / P(D) (log(P_i(D) /
        P'(D)) - K_i), over the number of trajectories, where K_i = sum_D P_i log(P_i / P').
        """
        held, drawn = belief > 0, self.likelihood[:, -1]
        seen = (drawn > 0) & np.any(self.likelihood[:, held] > 0, axis=1)
        likelihood, drawn, belief = self.likelihood[seen][:, held], drawn[seen], belief[held]
        logs = scipy.special.xlogy(likelihood, likelihood / (likelihood @ belief)[:, None])
        each = (logs - likelihood * np.sum(logs, axis=0)) @ belief
        return float(np.sqrt(np.sum(each**2 / drawn) / self.samples))

    def chance(self, belief: Floats) -> float:
        """Probability that a demonstration moves a tenth or more of a belief (C+1,) elsewhere."""
        joint = self.likelihood * belief
        outcome = np.sum(joint, axis=1)
        moved = np.sum(np.abs(joint - outcome[:, None] * belief), axis=1) / 2
        return float(np.sum(outcome[moved >= _REVEALS * outcome]))

    def learnt(self, beliefs: Floats, rng: np.random.Generator) -> Floats:
        """Beliefs (B, C+1) after a demonstration each, whose outcome is drawn by the belief."""
        cumulative = np.cumsum(beliefs @ self.likelihood.T, axis=1)
        draws = rng.random(len(beliefs))[:, None] * cumulative[:, -1:]
        joint = beliefs * self.likelihood[np.argmax(cumulative > draws, axis=1)]
        return joint / np.sum(joint, axis=1, keepdims=True)


def task_outcomes(violated: Bools, rates: Rates = PAPER) -> TaskOutcomes:
    """Probabilities of outcomes under all truths, from trajectories without a constraint.

    Args:
        violated: (B, C) which regions each trajectory violates, as far as that counts.
        rates: rule breaking of the demonstrators; their model error is in `violated`, see
            `as_forecast`.
    """
    outcomes, counts = np.unique(violated, axis=0, return_counts=True)
    under = under_truths(~outcomes, counts, rates.rule_breaking)
    share = np.append(counts / len(violated), 0.0)
    return TaskOutcomes(np.column_stack([under, share]), len(violated))


def under_truths(avoids: Bools, counts: Ints, unruly: float) -> Floats:
    """(O+1, C) probability of each outcome under each truth; columns add up to 1.

    The last outcome is what no trajectory shows: what is demonstrated under truths that hardly any
    of them avoids.

    Args:
        avoids: (O, C) which outcomes avoid each truth.
        counts: (O,) trajectories with each outcome.
        unruly: share of demonstrations that are the same under every truth, as by who breaks rules.
    """
    avoiding = np.where(avoids, counts[:, None], 0)
    total = np.sum(avoiding, axis=0)
    rare = total < _FEWEST
    obeying = np.where(rare, 0.0, avoiding / np.maximum(total, 1))
    share = np.append(counts / np.sum(counts), 0.0)
    return (1 - unruly) * np.vstack([obeying, rare]) + unruly * share[:, None]


def as_forecast(
    violated: Bools, avoidance: Floats, forecast: Floats, rng: np.random.Generator
) -> Bools:
    """Violations (B, C) by trajectories, changed so that they are as probable as forecast.

    Each trajectory has one uniform number for all regions. Where that is high, it loses the
    crossings that forecasts do not believe in, as if it were of an agent whom the model does not
    describe; where forecasts expect more crossings than the model, some that avoid are taken to
    cross. With forecasts (1 - eta) alpha + eta a share eta crosses nothing.

    Args:
        violated: (B, C) what trajectories of the model violate.
        avoidance: (C,) alpha, the model's probability of avoiding.
        forecast: (C,) the probability of avoiding that counts.
        rng: of the uniform numbers.
    """
    level = rng.permutation((np.arange(len(violated)) + 0.5) / len(violated))[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        stays = np.where(forecast >= avoidance, (1 - forecast) / (1 - avoidance), 1.0)
        joins = np.where(forecast < avoidance, 1 - forecast / avoidance, 0.0)
    return np.where(violated, level < np.nan_to_num(stays, nan=1.0), level < joins)
