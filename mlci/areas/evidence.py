"""What demonstrations say of one or two of many shapes, told by trajectories that are drawn.

A recursion gives the probability alpha of avoiding one set of regions together with each further
one. All pairs of thousands of shapes would take thousands of recursions a task, so that S
trajectories are drawn from each task's distribution instead: whether each crosses a shape is one
bit, and those bits tell of every pair at once. What no trajectory avoids has

    alpha = (avoided + 1) / (S + 1)

above 0, so that one demonstration brings no more than log(S + 1) nat. Whether a trajectory crosses
a shape is told on points of a raster; of the demonstrations, whose crossings exclude, it is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.sparse when it is first used
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration
from mlci.evidence import Rates, log_evidence
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.misfit import draw_among
from mlci.regions import Regions
from mlci.spaces import Bools, Floats, Ints, StateSpace, middle_and_half
from mlci.tabular import TabularModel

_STEP = 0.5  # of a raster cell: how far apart a trajectory's points are at most


@dataclass(frozen=True, eq=False)
class ShapeEvidence:
    """What N demonstrations say of C shapes, and of pairs of them.

    Attributes:
        avoided: for each demonstration which of C shapes each of S trajectories of its task avoids
            (S, C); None where the tabular model cannot do it, so that it says nothing.
        violated: (N, C) which shapes each demonstration enters.
        inside: (P, C) which points of the raster lie in each shape.
        raster: its cells are the points, P.
        rates: model error and rule breaking.
    """

    avoided: tuple[Bools | None, ...]
    violated: Bools
    inside: Bools
    raster: Grid
    rates: Rates

    @classmethod
    def of(
        cls,
        model: TabularModel,
        demonstrations: Sequence[Demonstration],
        shapes: Regions,
        raster: Grid,
        rates: Rates,
        *,
        samples: int,
        rng: np.random.Generator,
        exact_ends: bool = True,
    ) -> ShapeEvidence:
        """Draw the trajectories.

        Args:
            model: the tabular model; its own regions do not matter.
            demonstrations: N of them.
            shapes: the C shapes.
            raster: points on which trajectories are compared with shapes; one cell along each
                dimension that no shape bounds.
            rates: model error and rule breaking.
            samples: S, of each task.
            rng: of which each task has a stream of its own.
            exact_ends: as of `infer`.

        Raises:
            ValueError: no samples.
        """
        if samples < 1:
            raise ValueError(f"at least one trajectory is drawn for each task, not {samples}")
        points = raster.centers
        inside = np.stack(
            [shapes.shape(i).level(raster.space, points) < 0 for i in range(len(shapes))], axis=1
        )
        avoided: list[Bools | None] = []
        for each, own in zip(demonstrations, rng.spawn(len(demonstrations)), strict=True):
            distribution = TrajectoryDistribution.of_task(
                model, each.task, round_horizon=True, exact_ends=exact_ends
            )
            if not distribution.is_possible:
                avoided.append(None)
                continue
            met = points_met(raster, sample_paths(distribution, samples, own))
            avoided.append(~np.asarray(met @ inside.astype(np.float32), dtype=bool))
        violated = np.array([shapes.violated_by(each.states) for each in demonstrations])
        return cls(tuple(avoided), violated.reshape(-1, len(shapes)), inside, raster, rates)

    def of_some(self, demonstrations: ArrayLike) -> ShapeEvidence:
        """That of some demonstrations, by number."""
        some = np.asarray(demonstrations, dtype=np.int64)
        avoided = tuple(self.avoided[j] for j in some)
        return ShapeEvidence(avoided, self.violated[some], self.inside, self.raster, self.rates)

    @property
    def feasible(self) -> Ints:
        """Numbers of the shapes that no violation excludes, of those that hold a raster point."""
        excluded = ~np.any(self.inside, axis=0)
        if not self.rates.rule_breaking > 0:
            excluded |= np.any(self.violated, axis=0)
        return np.flatnonzero(~excluded)

    def of_sets(self, members: Ints) -> Bools:
        """(B, P) which points of the raster lie in sets (B, 2) of shapes, by their numbers."""
        return np.asarray((self.inside[:, members[:, 0]] | self.inside[:, members[:, 1]]).T)

    def pair_gains(self, shapes: Ints) -> Floats:
        """(B, B) gain [nat] of pairs of some shapes (B,), of each alone in the diagonal."""
        gain = np.zeros((len(shapes), len(shapes)))
        for of_task, violated in zip(self.avoided, self.violated[:, shapes], strict=True):
            alpha: Floats = np.ones(gain.shape)
            if of_task is not None:
                both = of_task[:, shapes].astype(np.float32)
                alpha = ((both.T @ both).astype(float) + 1) / (len(both) + 1)
            gain += log_evidence(alpha, violated[:, None] | violated[None, :], self.rates)
        return gain


def sample_paths(
    distribution: TrajectoryDistribution, count: int, rng: np.random.Generator
) -> Floats:
    """(count, T+1, n) trajectories, drawn by the soft optimal policy: centres of their cells.

    Exact ends are the task's: its start, and its goal in the dimensions in which that is a point.
    """
    centers, ends = distribution.model.grid.centers, distribution.ends
    if ends is None:
        return centers[distribution.sample(count, rng)[0]]
    steps, log_z = distribution.steps, distribution.log_z
    cell = np.full(count, distribution.start)
    cells = []
    for t in range(steps):
        if t == 0 or t == steps - 1:
            moves = distribution.start_moves if t == 0 else distribution.goal_moves
            cell = moves.successor[draw_among(moves, log_z[t + 1], cell, rng)]
        else:
            cell = distribution.draw_moves(t, cell, rng)[1]
        cells.append(cell)
    states = centers[np.stack(cells, axis=1)]
    middle, half = middle_and_half(ends.goal)
    states[:, -1] = np.where(half == 0, middle, states[:, -1])
    start = np.broadcast_to(ends.start, (count, 1, len(ends.start)))
    return np.concatenate([start, states], axis=1)


def points_met(raster: Grid, paths: Floats) -> scipy.sparse.csr_matrix:
    """(S, P) how often each of S paths (S, T+1, n), straight between its states, meets a cell."""
    space: StateSpace = raster.space
    steps = space.difference(paths[:, 1:], paths[:, :-1])
    parts = max(1, int(np.ceil(np.max(np.abs(steps) / raster.widths, initial=0) / _STEP)))
    share = (np.arange(parts) / parts)[:, None]
    points = paths[:, :-1, None, :] + share * steps[:, :, None, :]
    states = np.concatenate(
        [points.reshape(len(paths), -1, space.dimension), paths[:, -1:]], axis=1
    )
    number = raster.index(states)
    row, column = np.nonzero(number >= 0)
    met = (np.ones(len(row), dtype=np.float32), (row, number[row, column]))
    return scipy.sparse.csr_matrix(met, shape=(len(paths), raster.size))
