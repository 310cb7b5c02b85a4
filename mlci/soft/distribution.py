"""Soft constraints: a cost for the time inside a region, in place of a wall round it.

Under weight w [nat/s] a trajectory that spends the time tau(xi) inside the region has the
probability

    p_w(xi) = e^(R(xi) - w tau(xi)) / Z(w),    Z(w) = sum over xi of e^(R(xi) - w tau(xi)),

over the trajectories that end in the goal. w = 0 is no constraint, (2); as w grows, Z(w) falls to
the sum over trajectories that are never inside: that of (3), a wall. The weight in units of reward
is w times the model's temperature.

**Where tau comes from.** tau is the sum over moves of how long each is inside, so that Z(w) is one
backward recursion over moves whose reward is lowered by w times that (`mlci.recursions`). Moves
with one successor and different times may not be merged, as e^(-w t) is not linear in t: a mean
time would give Z(w) a bias of the order of w^2. So moves are merged here only if their successor
and their time inside are the same, which needs every single move: a model too large to keep its
moves is refused.

**Likelihood.** A demonstration j that spends tau_j inside, as it was recorded, is

    e^(-w tau_j) / A_j(w),    A_j(w) = Z_j(w) / Z_j(0) = E_0[e^(-w tau)],

times as likely as under no constraint. log A_j is convex in w, as a cumulant generating function,
so the log likelihood of N demonstrations is concave and has one maximum: at a finite weight, at 0
if they are inside no less than without a constraint, or at infinity if none ever is inside. With
the rates of `mlci.evidence`, an agent of whom the model says nothing is never inside, and a
rule breaker does as without a constraint:

    l_j(w) = log((1 - eps) e^(-w tau_j) / ((1 - eta) A_j(w) + eta) + eps),

which as w -> infinity becomes the evidence of the wall: A_j(inf) = alpha_j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.cells.protocol import check_has_cells
from mlci.end_moves import MovePaths, allowed_moves, first_paths, last_paths, only_paths
from mlci.maxent import TrajectoryDistribution
from mlci.merged_moves import MergedMoves, merge_moves
from mlci.recursions import backward_pass
from mlci.single_moves import SingleMoves
from mlci.soft.time_inside import move_times, path_times
from mlci.spaces import Floats
from mlci.tabular import TabularModel


@dataclass(frozen=True, eq=False)
class TimedMoves:
    """Moves that are told apart by how long they are inside a region.

    Attributes:
        moves: W merged moves.
        times: (W,) how long each is inside [s].
    """

    moves: MergedMoves
    times: Floats

    def under(self, weight: float) -> MergedMoves:
        """The moves with rewards lowered by weight [nat/s] times their time inside."""
        return replace(self.moves, log_weight=self.moves.log_weight - price(weight, self.times))


@dataclass(frozen=True, eq=False)
class SoftModel:
    """A tabular model and one of its regions, with how long each move is inside; see `soften`.

    Attributes:
        model: the tabular model, which keeps its moves.
        region: number of the region.
        times: (S, M) how long each move is inside the region [s].

    Raises:
        ValueError: a model too large to keep its moves, or times of another shape or below 0.
    """

    model: TabularModel
    region: int
    times: Floats

    def __post_init__(self) -> None:
        shape = self.model.states, self.model.moves
        if self.model.kept is None:
            raise ValueError(
                f"a soft constraint needs every single move, and {shape[0]} cells of {shape[1]} "
                "moves are too many to keep: take fewer cells, actions or start points"
            )
        if self.times.shape != shape or not np.all(self.times >= 0):
            raise ValueError(f"times inside need {shape} numbers of at least 0 s")

    @cached_property
    def moves(self) -> TimedMoves:
        """All moves, merged where successor and time inside are the same."""
        assert self.model.kept is not None
        distinct, label = np.unique(self.times, return_inverse=True)
        single, count = self.model.kept, self.times.size
        # The label takes the place of the region that a move crosses.
        labels = scipy.sparse.csr_matrix(
            (np.ones(count, dtype=bool), label.ravel(), np.arange(count + 1)),
            shape=(count, len(distinct)),
        )
        successor = np.where(single.allowed(self.model.truth), single.successor, -1)
        merged = merge_moves([SingleMoves(successor, single.reward, labels)])
        return TimedMoves(merged, distinct[merged.crossing_region])

    def under(self, weight: float) -> TabularModel:
        """The tabular model under the weight [nat/s]: rewards of its moves are lowered.

        Its trajectories begin and end at cells; `task` also takes those that end at states.
        """
        if np.isinf(weight):
            return self.model.under(np.arange(len(self.model.regions)) == self.region)
        assert self.model.kept is not None
        reward = self.model.kept.reward - price(weight, self.times)
        return replace(self.model, kept=replace(self.model.kept, reward=reward))

    def task(self, distribution: TrajectoryDistribution) -> SoftTask:
        """A task of the model, by its distribution without the constraint."""
        ends, last = distribution.ends, distribution.steps - 1
        if ends is None:
            return SoftTask(distribution, ((self.moves, 0, distribution.steps),))
        of_goal = distribution.goal, ends.goal
        if last == 0:
            only = self._timed([only_paths(self.model, ends.start, *of_goal)])
            return SoftTask(distribution, ((only, 0, 1),))
        first = self._timed([first_paths(self.model, ends.start)])
        cells = np.flatnonzero(distribution.reachable[-2])
        goal = self._timed(list(last_paths(self.model, cells, *of_goal)))
        legs = (first, 0, 1), (self.moves, 1, last), (goal, last, last + 1)
        return SoftTask(distribution, legs)

    def _timed(self, parts: Sequence[MovePaths]) -> TimedMoves:
        """Moves from or to states, none merged with another."""
        model = self.model
        times = [path_times(model.regions, self.region, path, model.dt) for *_, path in parts]
        return TimedMoves(allowed_moves(model, parts), np.concatenate(times))


@dataclass(frozen=True, eq=False)
class SoftTask:
    """The trajectories of one task under any weight.

    Attributes:
        distribution: without the constraint.
        legs: the moves of each part of the way, and the steps from which and to which it goes.
    """

    distribution: TrajectoryDistribution
    legs: tuple[tuple[TimedMoves, int, int], ...]

    def log_z(self, weight: float) -> float:
        """log Z(w) [nat] of a weight [nat/s], which may be infinite; -inf if nothing is left."""
        distribution, start = self.distribution, self.distribution.start
        legs = [(timed.under(weight), early, late) for timed, early, late in self.legs]
        table, _ = backward_pass(legs, distribution.reachable, distribution.goal, start, 0)
        return float(table[0, start])

    def log_share(self, weight: float) -> float:
        """log A(w) = log Z(w) - log Z(0) [nat]: that of the mean of e^(-w tau) without constraint.

        Raises:
            ValueError: no trajectory reaches a goal.
        """
        if not self.distribution.is_possible:
            raise ValueError("no trajectory reaches a goal: a soft constraint says nothing")
        return min(0.0, self.log_z(weight) - self._free)

    @cached_property
    def _free(self) -> float:
        return self.log_z(0.0)


def soften(model: TabularModel, region: int) -> SoftModel:
    """A tabular model with the time that each move is inside one of its regions.

    Args:
        model: the tabular model, small enough to keep its moves.
        region: number of the region.

    Raises:
        TypeError: a model without cells that all tasks share.
        ValueError: the model keeps no moves.
    """
    check_has_cells(model)
    if model.kept is None:  # the check says so, before anything is computed
        return SoftModel(model, region, np.zeros((model.states, model.moves)))
    return SoftModel(model, region, move_times(model, region))


def price(weight: float, times: Floats) -> Floats:
    """weight * times [nat], 0 where the time is 0 even if the weight is infinite."""
    return np.multiply(weight, times, where=times > 0, out=np.zeros(times.shape))
