"""The tabular model of a continuous system (section IV).

Two probabilistic models share these arrays, told apart by the number of start points a cell:

* **Centre model** (one start point, the paper's). From cell s, action a leads to the one cell that
  the flow from the centre x_s under u_a reaches after dt: the deterministic kernel (1).
* **Cell-averaged model** (k^n start points). Before every step the position inside the cell is
  drawn afresh, uniformly among the k^n centres of a regular subdivision. A trajectory is the
  sequence of cells, actions and draws; its probability is proportional to e^R times that of its
  draws, (1/k^n)^T, over all trajectories that end in the goal. So the draws are conditioned on the
  goal as the actions are: it is (2) for the deterministic MDP whose choices are pairs of action and
  start point, with a constant factor that cancels. It is not the causal-entropy policy of a
  stochastic MDP, under which the demonstrator could not count on reaching any goal cell.

Hence a cell has M *moves*: an action from one start point, in the order
move = action * k^n + start point. In the centre model a move is an action.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mlci.cells.protocol import Cells
from mlci.explored import Explored
from mlci.grids import Grid
from mlci.merged_moves import MergedMoves, merge_moves
from mlci.paths import PATHS_AT_ONCE, follow, substep_count
from mlci.regions import Regions, as_mask
from mlci.simulate import rollout
from mlci.single_moves import SingleMoves
from mlci.spaces import Bools, Box, Floats, Ints
from mlci.systems import System

_MOVES_AT_ONCE = 1 << 17  # what a step of long work holds beside its result: about 100 MB
MOST_KEPT = 1 << 24  # moves: half a gigabyte

Progress = Callable[[int, int], None]  # called with how much is done, and of how much


@dataclass(frozen=True, eq=False)
class TabularModel:
    """A deterministic tabular MDP, with the continuous system that it stands for.

    It knows neither start nor goal nor truth: one model serves all tasks, and `under` adds a truth.

    Attributes:
        system: the continuous system.
        grid: the S cells: `mlci.grids.Grid`, or `mlci.cells.box_tree.BoxTree`.
        actions: (A, m) controls, held for dt.
        dt: time step [s].
        regions: the C regions whose crossings are known: hypotheses, truths, or both.
        samples: k; the moves of an action start at k^n points of a cell.
        temperature: what the rewards are divided by, (2).
        truth: (C,) mask of the regions that no move may cross, see `under`; none by default.
        kept: the moves of all cells, whether or not the truth forbids them. None follows the
            dynamics anew where moves are asked for, in less memory; a model whose cells and moves
            stand for no dynamics has to keep them.
        explored: the cells whose moves `merged` has; None for all.

    Raises:
        ValueError: moves of another shape or to no cell; a dt or temperature not in (0, inf).
    """

    system: System
    grid: Cells
    actions: Floats
    dt: float
    regions: Regions
    samples: int = 1
    temperature: float = 1.0
    truth: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))
    kept: SingleMoves | None = None
    explored: Explored | None = None

    def __post_init__(self) -> None:
        if not len(self.truth):
            object.__setattr__(self, "truth", np.zeros(len(self.regions), dtype=bool))
        if not 0 < self.dt < np.inf:
            raise ValueError(f"a time step must be positive and finite, not {self.dt} s")
        if not 0 < self.temperature < np.inf:
            raise ValueError(f"a temperature must be positive and finite, not {self.temperature}")
        if self.kept is None:
            return
        shape, crosses = self.kept.successor.shape, self.kept.crosses.shape
        if shape != (self.states, self.moves) or crosses[1] != len(self.regions):
            raise ValueError(
                f"{self.states} cells of {self.moves} moves, {len(self.regions)} regions, "
                f"successor {shape} and crosses {crosses} do not agree"
            )
        if np.any(self.kept.successor >= self.states):
            raise ValueError("a move leads to no cell; one that leaves the grid has successor -1")

    @property
    def states(self) -> int:
        """S, the number of cells."""
        return self.grid.size

    @property
    def moves(self) -> int:
        """M, the number of moves of a cell."""
        return int(len(self.actions) * self.samples**self.grid.space.dimension)

    @property
    def equal_cells(self) -> Grid:
        """The grid, for what needs cells of one size.

        Raises:
            TypeError: cells of varying size.
        """
        if not isinstance(self.grid, Grid):
            raise TypeError(f"this needs a Grid of equal cells, not a {type(self.grid).__name__}")
        return self.grid

    @cached_property
    def action(self) -> Ints:
        """(M,) index of the action that a move applies."""
        return np.repeat(np.arange(len(self.actions)), self.moves // len(self.actions))

    @cached_property
    def substeps(self) -> int:
        """Integrator steps of a move."""
        return substep_count(self.system, self.grid, self.actions, self.dt)

    def move_origins(self, cells: Ints, moves: Ints) -> Floats:
        """(L, n) the states in which some moves of some cells begin."""
        inside = self.grid.points_inside(self.samples, cells)
        return inside[np.arange(len(cells)), moves % inside.shape[1]]

    def move_reward(self, states: Floats, controls: Floats) -> Floats:
        """(L,) reward r dt / temperature [nat] of controls (L, m) held from states (L, n)."""
        return self.system.running_reward(states, controls) * (self.dt / self.temperature)

    def moves_of(self, cells: Ints) -> SingleMoves:
        """All moves of some cells (Q,), whether or not the truth forbids them."""
        if self.kept is not None:
            return self.kept.of(cells)
        size = max(1, PATHS_AT_ONCE // self.moves)
        firsts = range(0, max(1, len(cells)), size)
        return SingleMoves.joined([self._follow(cells[first : first + size]) for first in firsts])

    def policy_moves(self, cells: Ints) -> tuple[Ints, Floats]:
        """Successors (Q, M) of the moves of some cells, and rewards, -inf where not allowed."""
        if self.kept is not None:
            return self.kept.successor[cells], self._kept_reward[cells]
        moves = self.moves_of(cells)
        return moves.successor, moves.allowed_reward(self.truth)

    @cached_property
    def _kept_reward(self) -> Floats:
        assert self.kept is not None
        return self.kept.allowed_reward(self.truth)

    def _follow(self, cells: Ints) -> SingleMoves:
        """The moves of some cells (Q,) by the dynamics."""
        inside = self.grid.points_inside(self.samples, cells).reshape(-1, self.grid.space.dimension)
        controls = self.actions[:, None, :]
        path = rollout(self.system, inside, controls[:, :, None, :], self.dt, self.substeps)
        end, crosses = follow(self.grid, self.regions, path.reshape(-1, *path.shape[-2:]))
        # Numpy is fast where an action is applied to many states; a cell's moves belong together.
        shape = len(cells), self.moves
        by_action = np.arange(len(end)).reshape(
            len(controls), len(cells), shape[1] // len(controls)
        )
        order = by_action.swapaxes(0, 1).ravel()
        reward = np.broadcast_to(self.move_reward(inside, controls), path.shape[:2]).ravel()
        return SingleMoves(end[order].reshape(shape), reward[order].reshape(shape), crosses[order])

    @cached_property
    def merged(self) -> MergedMoves:
        """The moves of each cell, those with the same successor and crossings merged."""
        merged = merge_moves(self.moves_of(cells) for cells in self.blocks())
        if self.explored is not None:
            merged = merged.placed(np.flatnonzero(self.explored.cells), self.states)
        return merged.under(self.truth)

    def blocks(self, cells: Ints | None = None) -> Iterator[Ints]:
        """Some cells, or all that are explored, in blocks of so many moves as one step of work
        should hold."""
        if cells is None:
            known = self.explored
            cells = np.arange(self.states) if known is None else np.flatnonzero(known.cells)
        size = max(1, _MOVES_AT_ONCE // self.moves)
        for first in range(0, max(1, len(cells)), size):
            yield cells[first : first + size]

    def crossed(self, cells: Ints, moves: Ints) -> Bools:
        """(..., C) which regions trajectories of moves (..., T) from cells (..., T) cross."""
        here, place = np.unique(cells, return_inverse=True)
        rows = self.moves_of(here).crosses[place.ravel() * self.moves + moves.ravel()]
        return np.any(rows.toarray().reshape(*moves.shape, len(self.regions)), axis=-2)

    def with_temperature(self, temperature: float) -> TabularModel:
        """The model at another temperature: moves are the same, rewards scale.

        Raises:
            ValueError: a temperature that is not positive and finite.
        """
        model = replace(self, kept=None, temperature=temperature)
        if self.kept is None:
            return model
        reward = self.kept.reward * (self.temperature / temperature)
        return replace(model, kept=replace(self.kept, reward=reward))

    def under(self, truth: ArrayLike) -> TabularModel:
        """The model under constraints, equation (3): moves that cross the truth are not allowed.

        Args:
            truth: (C,) mask over the regions, such as `model.regions.mask(["c1"])`.
        """
        mask = as_mask(truth, len(self.regions))
        constrained = replace(self, truth=self.truth | mask)
        if "merged" in vars(self):  # what takes the time has been done
            vars(constrained)["merged"] = self.merged.under(mask)
        return constrained


def action_grid(
    system: System, counts: int | Sequence[int], action_range: Box | None = None
) -> Floats:
    """(A, m) actions evenly spaced over the control box, its ends included (section IV-B).

    Args:
        system: gives the control box.
        counts: number of values of each control, or one number for all; a single value is the
            middle of its range.
        action_range: takes the place of the control box: the control noise of the tabular agent
            depends on it, see `mlci.diagnosis`.

    Raises:
        ValueError: a count below 1, or a list or a range of the wrong length.
    """
    box = system.control_box if action_range is None else action_range
    if box.dimension != system.control_box.dimension:
        raise ValueError(
            f"{system.control_box.dimension} controls need as many ranges, not {box.dimension}"
        )
    values = np.broadcast_to(counts, box.dimension) if np.ndim(counts) == 0 else np.array(counts)
    if values.shape != (box.dimension,) or values.dtype.kind not in "iu" or np.min(values) < 1:
        raise ValueError(
            f"{box.dimension} controls need as many whole counts of at least 1, not {counts}"
        )
    ticks = [
        np.linspace(low, high, count) if count > 1 else np.array([(low + high) / 2])
        for low, high, count in zip(box.lower, box.upper, values.tolist(), strict=True)
    ]
    return np.stack([part.ravel() for part in np.meshgrid(*ticks, indexing="ij")], axis=-1)


def moves_are_kept(cells: float, moves: float) -> bool:
    """Whether `discretize` keeps each of the moves of so many cells, or the merged ones alone."""
    return cells * moves <= MOST_KEPT


def discretize(
    system: System,
    grid: Cells,
    actions: ArrayLike,
    dt: float,
    regions: Regions,
    samples: int = 1,
    temperature: float = 1.0,
    progress: Progress | None = None,
) -> TabularModel:
    """Form the tabular model of a continuous system, equation (1) and section IV-C.

    Each move follows the true dynamics for dt. It is not allowed where its path leaves the state
    space, and it crosses every region that the path enters, ends included.

    Args:
        system: the dynamics and the running reward r.
        grid: the cells.
        actions: (A, m) controls, held for dt.
        dt: time step [s].
        regions: the C regions whose crossings are kept: hypotheses, truths, or both.
        samples: k; an action's moves start at k^n points of the cell (see the module's head).
        temperature: divides the reward (2).
        progress: called with how many cells are done, and of how many.
    """
    model = TabularModel(
        system, grid, np.asarray(actions, dtype=float), dt, regions, samples, temperature
    )

    def blocks() -> Iterator[SingleMoves]:
        for cells in model.blocks():
            yield model.moves_of(cells)
            if progress is not None:
                progress(int(cells[-1]) + 1, grid.size)

    if not moves_are_kept(model.states, model.moves):
        vars(model)["merged"] = merge_moves(blocks())
        return model
    full = replace(model, kept=SingleMoves.joined(list(blocks())))
    vars(full)["substeps"] = model.substeps  # counted once
    return full
