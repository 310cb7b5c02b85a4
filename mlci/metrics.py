"""The study's measures (section V): final-state error, violation distance, rank of the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.special when it is first used
from numpy.typing import ArrayLike

from mlci.evidence import posterior
from mlci.spaces import Bools, Box, Floats, Ints, StateSpace


def final_state_error(space: StateSpace, final: ArrayLike, goal: Box) -> Floats:
    """Normalised distance (...,) of final states (..., n) to the goal, the measure of Fig. 3.

    Each dimension's difference, the short way round, is divided by its range; then Euclidean.
    """
    return np.linalg.norm(space.excess(final, goal) / space.bounds.widths, axis=-1)


@dataclass(frozen=True, eq=False)
class ViolationDistance:
    """Equation (11) for each demonstration alone and for all of them pooled.

    Attributes:
        each: (N,) sum_i |Phi_i - D_i|.
        floor: (N,) sum_i 2 Phi_i (1 - Phi_i): what `each` is on average for demonstrations drawn
            from the tabular model itself.
        shares: (N,) sum_i s_i (Phi_i - D_i), where s_i is the sign of the mean of Phi_i - D_i over
            all demonstrations: what each adds to the pooled distance.
    """

    each: Floats
    floor: Floats
    shares: Floats

    @property
    def pooled(self) -> float:
        """sum_i |mean Phi_i - mean D_i|, the mean of `shares`; it does go to 0 for those."""
        return float(np.mean(self.shares))


def violation_distance(phi: ArrayLike, violated: ArrayLike) -> ViolationDistance:
    """Equation (11): expected against observed violations.

    Args:
        phi: (N, C) violation probabilities under the true constraint.
        violated: (N, C) what the demonstrations violate.
    """
    phi, observed = np.asarray(phi, dtype=float), np.asarray(violated, dtype=float)
    excess = phi - observed
    return ViolationDistance(
        each=np.sum(np.abs(excess), axis=1),
        floor=np.sum(2 * phi * (1 - phi), axis=1),
        shares=excess @ np.sign(np.mean(excess, axis=0)),
    )


def random_subsets(
    population: int, largest: int, count: int, rng: np.random.Generator
) -> list[Ints]:
    """For each size 1 .. largest, `count` random subsets: arrays (count, size) of indices.

    Nested: the subset of size k is the first k of a random order of all, so that a curve over
    the sizes follows demonstrations as they arrive.
    """
    orders = np.stack([rng.permutation(population) for _ in range(count)])
    return [orders[:, :size] for size in range(1, min(largest, population) + 1)]


def truth_ranks(ranks: Floats, truth: Bools) -> Floats:
    """Rank of the truth in each of B rankings, the measure of Fig. 5.

    Args:
        ranks: (B, C) from 1, such as of random subsets of demonstrations; see
            `mlci.evidence.rank_scores`.
        truth: (C,) which hypotheses the true constraint covers; the best ranked one counts.

    Returns:
        (B,) ranks from 1; ties share their mean rank. NaN if the truth covers no hypothesis.
    """
    if not np.any(truth):
        return np.full(len(ranks), np.nan)
    return np.asarray(np.min(ranks[:, truth], axis=1))


def top_chances(ranks: Floats, good: Bools, top: int) -> Floats:
    """Whether the `top` best hypotheses of each ranking are all good, the measure of Fig. 7.

    Args:
        ranks: (B, C) as for `truth_ranks`.
        good: (C,) which hypotheses count, such as those that overlap the truth.
        top: how many of the best there must be.

    Returns:
        (B,) 1 or 0; between them where the last places are tied: the chance that all are good if
        the tie is broken at random.
    """
    last = np.partition(ranks, top - 1, axis=1)[:, [top - 1]]
    before, tied = ranks < last, ranks == last
    places = top - np.sum(before, axis=1)
    fitting, all_ways = (
        scipy.special.comb(np.sum(part, axis=1), places) for part in (tied & good, tied)
    )
    return np.asarray(np.all(good | ~before, axis=1) * fitting / all_ways)


def claims(gains: Floats, prior_none: float) -> Floats:
    """(B,) posterior probability of the most likely hypothesis of each ranking.

    Beside the share of rankings whose best hypothesis is the truth, it says how sure is too sure.

    Args:
        gains: (B, C) [nat], such as of random subsets of demonstrations.
        prior_none: prior probability that there is no constraint.
    """
    return np.asarray(np.max(posterior(gains, prior_none)[0], axis=1))
