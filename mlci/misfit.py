"""Misfit: how improbable the tabular model finds the set of regions that a demonstration crosses.

Two numbers describe it: how many regions the demonstration violates, and sum_i |Phi_i - D_i|, its
distance from what is expected (11). Both are compared with trajectories that are drawn from the
maximum entropy distribution of the same task, without a constraint.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from mlci.maxent import TrajectoryDistribution
from mlci.merged_moves import MergedMoves
from mlci.models import Distribution
from mlci.sampled.distribution import SampledDistribution
from mlci.spaces import Bools, Floats, Ints

SAMPLES = 249  # of each task: p of two sides is then 2 / 250 at least, which is below RARE
RARE = 0.01  # a p below it is a warning


@dataclass(frozen=True, eq=False)
class Misfit:
    """How N demonstrations compare with what the tabular model draws for their tasks.

    Attributes:
        count: (N,) number of regions that each violates.
        distance: (N,) sum_i |Phi_i - D_i|.
        count_p: (N,) p of so few or so many regions, two-sided; NaN where the model cannot do the
            task.
        distance_p: (N,) p of a distance at least as large; NaN likewise.
    """

    count: Ints
    distance: Floats
    count_p: Floats
    distance_p: Floats

    @property
    def is_rare(self) -> Bools:
        """(N,) whether one of both p is below 0.01; about one in 50 of the model's own is."""
        return (self.count_p < RARE) | (self.distance_p < RARE)


def misfit(
    distributions: Iterable[Distribution],
    phi: Floats,
    violated: Bools,
    *,
    hypotheses: Bools | None = None,
    samples: int = SAMPLES,
) -> Misfit:
    """Compare demonstrations with trajectories drawn for their tasks; the same each time.

    Args:
        distributions: N, of the demonstrations' tasks.
        phi: (N, C) probability that the model violates a region.
        violated: (N, C) D, which regions each demonstration violates.
        hypotheses: (C',) mask of the C regions among the model's; None where these are all.
        samples: trajectories drawn for each task. p = (1 + number at least as extreme) / (1 +
            samples), which is never 0; with none, p is NaN.
    """
    count, distance = np.sum(violated, axis=1), np.sum(np.abs(phi - violated), axis=1)
    count_p, distance_p = np.full((2, len(violated)), np.nan)
    for j, distribution in enumerate(distributions if samples else ()):
        if not distribution.is_possible:
            continue
        crossed = sample_crossings(distribution, samples, np.random.default_rng(0))
        drawn = crossed if hypotheses is None else crossed[:, hypotheses]
        counts, distances = np.sum(drawn, axis=1), np.sum(np.abs(phi[j] - drawn), axis=1)
        tails = [_tail(counts >= count[j]), _tail(counts <= count[j])]
        count_p[j] = min(1.0, 2 * min(tails))
        distance_p[j] = _tail(distances >= distance[j] - 1e-9)  # a tie, but for rounding
    return Misfit(count, distance, count_p, distance_p)


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
