"""Misfit: how unlike what is expected the set of regions is that a demonstration crosses.

Two numbers describe it: how many regions the demonstration violates, and sum_i |Phi_i - D_i|, its
distance from what is expected (11). They are compared with two kinds of paths:

* trajectories that are drawn from the maximum entropy distribution of the same task. These tell
  how well the model describes the demonstration. Optimal paths are no such draws: on a coarse model
  many of them are rare among these;
* simulated demonstrations without a constraint (`mlci.calibration`). These tell whether the
  demonstration is unlike what the demonstrator does in such tasks, however well the model fits him.
  What is compared is the excess, the distance less its floor sum_i 2 Phi_i (1 - Phi_i), which is
  its mean for the model's own. Among n of them and the demonstration every rank of its excess is
  equally probable, so that p = (1 + number at least as large) / (1 + n) is below 0.01 for one in
  100 at most.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import singledispatch

import numpy as np
import scipy  # loads scipy.special when it is first used
from numpy.typing import ArrayLike

from mlci.maxent import TrajectoryDistribution
from mlci.merged_moves import MergedMoves
from mlci.models import Distribution
from mlci.sampled.distribution import SampledDistribution
from mlci.spaces import Bools, Floats, Ints

SAMPLES = 249  # of each task: p of two sides is then 2 / 250 at least, which is below RARE
RARE = 0.01  # a p below it is rare
_ALARM = 0.05  # probability at most, that right demonstrations give a warning


@dataclass(frozen=True, eq=False)
class Misfit:
    """How N demonstrations compare with what the tabular model draws for their tasks.

    Attributes:
        count: (N,) number of regions that each violates.
        distance: (N,) sum_i |Phi_i - D_i|.
        count_p: (N,) p of so few or so many regions, two-sided; NaN where the model cannot do the
            task.
        distance_p: (N,) p of a distance at least as large; NaN likewise.
        excess: (N,) the distance less its floor sum_i 2 Phi_i (1 - Phi_i).
        unlike_p: (N,) p of an excess at least as large, among simulated demonstrations; NaN where
            there are too few of these for a p below 0.01, or the model cannot do the task.
        simulated: n, the number of simulated demonstrations.
    """

    count: Ints
    distance: Floats
    count_p: Floats
    distance_p: Floats
    excess: Floats
    unlike_p: Floats
    simulated: int = 0

    @property
    def is_rare(self) -> Bools:
        """(N,) whether `count_p` or `distance_p` is below 0.01; one in 50 of the model's own is."""
        return (self.count_p < RARE) | (self.distance_p < RARE)

    @property
    def is_unlike(self) -> Bools:
        """(N,) whether `unlike_p` is below 0.01; one in 100 of simulated demonstrations is."""
        return self.unlike_p < RARE

    def warnings(self, names: Sequence[str]) -> list[str]:
        """What is doubtful of demonstrations (N,) with these names, in words.

        Where simulated demonstrations are known, it is that more are unlike them than chance
        explains: in one of 20 sets of such demonstrations at most. Else it is what the model finds
        rare, which says little of optimal paths.
        """
        known = np.isfinite(self.unlike_p)
        if not known.any():
            rare, count = np.flatnonzero(self.is_rare).tolist(), len(names)
            if not len(rare):
                return []
            return [
                f"{len(rare)} of {count} demonstrations cross other regions than the model's own "
                f"trajectories do (p < {RARE}; one in 50 of these does so). Optimal paths often do "
                "so too: only a calibration tells whether that is unusual: "
                + listed([names[j] for j in rare])
            ]
        unlike, count = np.flatnonzero(self.is_unlike).tolist(), int(np.sum(known))
        chance = _chance(len(unlike), count, self.simulated)
        if chance > _ALARM:
            return []
        return [
            f"{len(unlike)} of {count} demonstrations cross other regions than simulated "
            f"demonstrations without a constraint do (p < {RARE} each; so many by chance in "
            f"{chance:.1%} of such sets): " + listed([names[j] for j in unlike])
        ]


def listed(names: Sequence[str], most: int = 8) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def excess_of(phi: Floats, violated: Bools) -> Floats:
    """(N,) how far sum_i |Phi_i - D_i| is above its floor, for Phi (N, C) and D (N, C)."""
    return np.asarray(np.sum(np.abs(phi - violated) - 2 * phi * (1 - phi), axis=1))


def misfit(
    distributions: Iterable[Distribution],
    phi: Floats,
    violated: Bools,
    *,
    hypotheses: Bools | None = None,
    samples: int = SAMPLES,
    simulated: ArrayLike = (),
) -> Misfit:
    """Compare demonstrations with trajectories drawn for their tasks; the same each time.

    Args:
        distributions: N, of the demonstrations' tasks.
        phi: (N, C) probability that the model violates a region.
        violated: (N, C) D, which regions each demonstration violates.
        hypotheses: (C',) mask of the C regions among the model's; None where these are all.
        samples: trajectories drawn for each task. p = (1 + number at least as extreme) / (1 +
            samples), which is never 0; with none, p is NaN.
        simulated: (n,) excess of simulated demonstrations, as of `mlci.Calibration`.
    """
    count, distance = np.sum(violated, axis=1), np.sum(np.abs(phi - violated), axis=1)
    excess, others = excess_of(phi, violated), np.asarray(simulated, dtype=float)
    count_p, distance_p, unlike_p = np.full((3, len(violated)), np.nan)
    is_compared = len(others) >= 1 / RARE
    # Without anything to compare with, no distribution is asked for: sampled ones take seconds.
    for j, distribution in enumerate(distributions if samples or is_compared else ()):
        if not distribution.is_possible:
            continue
        if is_compared:
            unlike_p[j] = _tail(others >= excess[j] - 1e-9)
        if not samples:
            continue
        crossed = sample_crossings(distribution, samples, np.random.default_rng(0))
        drawn = crossed if hypotheses is None else crossed[:, hypotheses]
        counts, distances = np.sum(drawn, axis=1), np.sum(np.abs(phi[j] - drawn), axis=1)
        tails = [_tail(counts >= count[j]), _tail(counts <= count[j])]
        count_p[j] = min(1.0, 2 * min(tails))
        distance_p[j] = _tail(distances >= distance[j] - 1e-9)  # a tie, but for rounding
    return Misfit(count, distance, count_p, distance_p, excess, unlike_p, len(others))


@singledispatch
def sample_crossings(distribution: Distribution, count: int, rng: np.random.Generator) -> Bools:
    """(count, C) which of the model's regions trajectories cross, drawn by the soft optimal policy,
    or from those that were sampled before.

    Raises:
        ValueError: no trajectory reaches a goal.
    """
    raise TypeError(f"a {type(distribution).__name__} is no distribution of a task")


@sample_crossings.register
def _of_samples(distribution: SampledDistribution, count: int, rng: np.random.Generator) -> Bools:
    return distribution.crossings(count, rng)


@sample_crossings.register
def _of_cells(distribution: TrajectoryDistribution, count: int, rng: np.random.Generator) -> Bools:
    model, steps = distribution.model, distribution.steps
    if distribution.ends is None:
        path, taken = distribution.sample(count, rng)
        return model.crossed(path[:, :-1], taken)
    if not distribution.is_possible:
        raise ValueError("no trajectory reaches a goal: nothing to sample")
    log_z, cell = distribution.log_z, np.full(count, distribution.start)
    first = distribution.start_moves
    move = draw_among(first, log_z[1], cell, rng)
    crossed, cells, moves = first.crosses(move, len(model.regions)), [first.successor[move]], []
    if steps == 1:
        return crossed
    for t in range(1, steps - 1):
        move, successor = distribution.draw_moves(t, cells[-1], rng)
        moves.append(move)
        cells.append(successor)
    if moves:
        crossed |= model.crossed(np.stack(cells[:-1], axis=1), np.stack(moves, axis=1))
    last = distribution.goal_moves
    move = draw_among(last, log_z[steps], cells[-1], rng)
    return crossed | last.crosses(move, len(model.regions))


def draw_among(
    moves: MergedMoves, log_z_after: Floats, cell: Ints, rng: np.random.Generator
) -> Ints:
    """(count,) for each cell (count,), one of the moves that begin in it, by its probability."""
    value = moves.log_weight + log_z_after[moves.successor]
    drawn = np.empty(len(cell), dtype=np.int64)
    for here in np.unique(cell):
        among = np.arange(moves.begins[here], moves.begins[here + 1])
        who = np.flatnonzero(cell == here)
        cumulative = np.cumsum(np.exp(value[among] - np.max(value[among])))
        draws = rng.random(len(who)) * cumulative[-1]
        drawn[who] = among[np.searchsorted(cumulative, draws, side="right")]
    return drawn


def _tail(extreme: Bools) -> float:
    """p of a Monte Carlo test, of which samples are at least as extreme."""
    return (1 + int(np.sum(extreme))) / (1 + len(extreme))


def _chance(unlike: int, count: int, simulated: int) -> float:
    """Probability that so many or more of N demonstrations are unlike n that are like them.

    That is that so many of the N are above the r-th largest of the n, with the largest r below
    0.01 (n + 1). As all orders of the N + n are equally probable, k are with probability
    C(k + r - 1, k) C(N - k + n - r, N - k) / C(N + n, N).
    """
    if not unlike:
        return 1.0
    rank = math.ceil(RARE * (simulated + 1)) - 1  # p is below 0.01, not equal to it
    k = np.arange(unlike, count + 1)
    total = _log_choose(count + simulated, count)
    above, below = (
        _log_choose(k + rank - 1, k),
        _log_choose(count - k + simulated - rank, count - k),
    )
    return float(np.sum(np.exp(above + below - total)))


def _log_choose(of: ArrayLike, taken: ArrayLike) -> Floats:
    """log of the binomial coefficient."""
    n, k = np.asarray(of, dtype=float), np.asarray(taken, dtype=float)
    log = scipy.special.gammaln
    return np.asarray(log(n + 1) - log(k + 1) - log(n - k + 1))
