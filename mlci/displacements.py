"""How far the moves of a cell go, told before they are followed, and from where a goal is far.

Each action is followed from the centre of each cell. Over a cell, a displacement is taken to lie
between the least and the largest of those from its own centre and the centres around it, corners
included: true where a displacement has no extreme of its own between two centres. Who follows the
moves of a cell can `check` it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mlci.grids import Grid
from mlci.simulate import rollout
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import TabularModel

_HAIR = 1e-6  # of a cell, for rounding


@dataclass(frozen=True, eq=False)
class Displacements:
    """Where the moves of each cell lead at most, counted in cells along each dimension.

    Attributes:
        grid: the S cells.
        least, most: (S, n) bounds of place after less place before, not wrapped.
    """

    grid: Grid
    least: Ints
    most: Ints

    @classmethod
    def of(cls, model: TabularModel, n_jobs: int = 1) -> Displacements:
        """The displacements of a model's moves."""
        from joblib import Parallel, delayed

        centre = replace(model, samples=1, kept=None)
        vars(centre)["substeps"] = model.substeps  # counted once
        # Processes, as the user's dynamics are Python.
        work = Parallel(n_jobs=n_jobs, max_nbytes=None)
        parts = work(delayed(_from_centres)(centre, cells) for cells in centre.blocks())
        least, most = (np.concatenate(bounds) for bounds in zip(*parts, strict=True))
        grid, inside = model.equal_cells, 0.5 - 0.5 / model.samples
        return cls(
            grid,
            np.floor(_around(grid, least, np.minimum) + 0.5 - inside - _HAIR).astype(np.int16),
            np.floor(_around(grid, most, np.maximum) + 0.5 + inside + _HAIR).astype(np.int16),
        )

    def towards(self, goal: Ints, steps: int) -> Bools:
        """(T+1, S) from which cells some of the goal's (G,) may be reached in 0 .. T moves.

        Along each dimension alone: whether a place of the goal's is within reach.
        """
        shape = self.grid.shape
        places = np.unravel_index(np.arange(self.grid.size), shape)
        towards = np.zeros((steps + 1, self.grid.size), dtype=bool)
        towards[0, goal] = True
        for t in range(steps):
            towards[t + 1] = True
            for d, count in enumerate(shape):
                met = np.bincount(places[d][towards[t]], minlength=count) > 0
                met = np.tile(met, 3) if self.grid.space.periodic[d] else np.pad(met, count)
                before = np.append(0, np.cumsum(met))
                first = np.clip(places[d] + self.least[:, d], -count, 2 * count - 1) + count
                last = np.clip(places[d] + self.most[:, d], -count, 2 * count - 1) + count
                towards[t + 1] &= before[last + 1] > before[first]
        return towards

    def check(self, cells: Ints, successor: Ints) -> None:
        """See that moves (L,) from some cells to successors do not go further.

        Raises:
            ValueError: one does.
        """
        shape = np.array(self.grid.shape)
        before, after = (np.stack(np.unravel_index(each, shape), -1) for each in (cells, successor))
        least, most, moved = self.least[cells], self.most[cells], after - before
        turns = np.round((moved - (least + most) / 2) / shape).astype(np.int64)
        moved -= np.where(self.grid.space.periodic, turns * shape, 0)
        beyond = (moved < least) | (moved > most)
        if np.any(beyond):
            cell = cells[np.argmax(np.any(beyond, axis=1))]
            raise ValueError(
                f"moves of cell {cell} lead further than those from the centres around it: the "
                "dynamics change too much within a cell to tell from where the goal is far; "
                "explore(..., bounded=False) does without"
            )


def _from_centres(centre: TabularModel, cells: Ints) -> tuple[Floats, Floats]:
    """The least and the largest displacement (Q, n) from the centres of some cells, in cells."""
    origin, controls = centre.grid.points_inside(1, cells)[:, 0], centre.actions[:, None, :]
    path = rollout(centre.system, origin, controls[:, :, None, :], centre.dt, centre.substeps)
    moved = (path[:, :, -1] - origin) / centre.grid.widths
    return (
        np.min(np.where(np.isnan(moved), -np.inf, moved), axis=0),
        np.max(np.where(np.isnan(moved), np.inf, moved), axis=0),
    )


def _around(grid: Grid, bound: Floats, extreme: np.ufunc) -> Floats:
    """The extreme (S, n) of a bound over each cell and all cells that touch it."""
    bound = bound.reshape(*grid.shape, -1)
    for d, wraps in enumerate(grid.space.periodic):
        padding = [(int(axis == d), int(axis == d)) for axis in range(bound.ndim)]
        padded = np.pad(bound, padding, mode="wrap" if wraps else "edge")
        before, here, after = (
            np.take(padded, range(first, first + grid.shape[d]), axis=d) for first in range(3)
        )
        bound = extreme(extreme(before, here), after)
    # Beyond all cells is as far as one has to tell.
    most = 2.0 * max(grid.shape)
    return np.clip(bound.reshape(grid.size, -1), -most, most)
