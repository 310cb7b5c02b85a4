"""The multilinear model: a move is shared among the 2^n cells around its end.

A third probabilistic model beside the two of `mlci.tabular`. From the centre of a cell the flow
under an action ends at a state x', between the centres of 2^n cells; chance takes the trajectory to
the centre of one of them, with the weights p_j of multilinear interpolation at x'. The mean of
these centres is x' itself, and their variance along a dimension of width w is f (1 - f) w^2 with f
the place of x' between two centres, so at most w^2 / 4. The drift is that of the dynamics without
error, but in the half cell at a border of the space, and the variance that is added vanishes with
w: the Markov chain approximation of Kushner and Dupuis (2001, "Numerical Methods for Stochastic
Control Problems in Continuous Time"), used on cells by Munos and Moore (2002).

Chance makes trajectories random beside the choice of actions, and two distributions could be meant:

* **Draws conditioned on the goal** (this model): a trajectory is the sequence of cells, actions and
  draws, with a probability proportional to e^R times that of its draws, over all that end in the
  goal. Z_t(s) = sum_a e^r sum_j p_j Z_(t+1)(s_j): Z is interpolated, which discretises the linear
  equation Z_t(x) = sum_a e^r Z_(t+1)(x') of the deterministic system. The cell-averaged model
  treats its draws alike, so that the three models differ by where a move leads alone.
* **Causal entropy** interpolates log Z: an agent that chooses actions and not luck. With a hard
  goal it has no solution: a draw that misses the goal, however improbable, has log Z = -inf, and an
  interpolation that meets -inf is -inf. It would need a soft goal, and be another model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.simulate import rollout
from mlci.single_moves import SingleMoves
from mlci.spaces import Floats, Ints
from mlci.tabular import TabularModel


@dataclass(frozen=True, eq=False)
class MultilinearModel(TabularModel):
    """A tabular model whose moves are shared among the cells around their ends, see above.

    A cell has M = A 2^n moves, in the order move = action * 2^n + corner; the reward of each has
    log p_j added. Cells are equal, and moves start at the centres.

    Raises:
        ValueError: start points other than the centre.
        TypeError: cells of varying size.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.equal_cells
        if self.samples != 1:
            raise ValueError(
                f"a multilinear model starts at centres: samples must be 1, not {self.samples}"
            )

    @property
    def moves(self) -> int:
        """M, the number of moves of a cell."""
        return int(len(self.actions) * 2**self.grid.space.dimension)

    def move_origins(self, cells: Ints, moves: Ints) -> Floats:
        """(L, n) the states in which some moves (L,) of some cells (L,) begin: their centres."""
        return self.grid.points_inside(1, cells)[:, 0]

    def _follow(self, cells: Ints) -> SingleMoves:
        """The moves of some cells (Q,) by the dynamics."""
        origin, controls = self.grid.points_inside(1, cells)[:, :1], self.actions[:, None, :]
        path = rollout(self.system, origin, controls, self.dt, self.substeps)
        reward = np.broadcast_to(self.move_reward(origin, self.actions), path.shape[:2])
        path = path.reshape(-1, *path.shape[2:])
        stays = np.all(self.grid.space.contains(path), axis=-1)
        corner, weight = self._around(path[:, -1])
        with np.errstate(divide="ignore"):
            log_weight = np.log(weight)
        successor = np.where(stays[:, None] & (weight > 0), corner, -1)
        crosses = self.regions.crossings(path[:, :-1], np.diff(path, axis=1), stays)
        shape, corners = (len(cells), self.moves), corner.shape[1]
        rows = np.repeat(np.arange(len(path)), corners)
        shared = np.where(successor >= 0, reward.reshape(-1, 1) + log_weight, 0.0)
        return SingleMoves(successor.reshape(shape), shared.reshape(shape), crosses[rows])

    def _around(self, states: Floats) -> tuple[Ints, Floats]:
        """The cells (L, 2^n) around states (L, n) by their centres, and their weights, which add up
        to 1; beyond the outermost centres these take all."""
        grid, n = self.equal_cells, self.grid.space.dimension
        cell, weight = np.zeros((len(states), 1), dtype=np.int64), np.ones((len(states), 1))
        states = np.where(np.isfinite(states), states, 0.0)  # what leaves the space has no cell
        for d in range(n):
            count = grid.shape[d]
            place = (states[:, d] - grid.axes[d][0]) / grid.widths[d]
            low = np.floor(place)
            share = (place - low)[:, None]
            sides = np.stack([low, low + 1], axis=1)
            sides = sides % count if grid.space.periodic[d] else np.clip(sides, 0, count - 1)
            sides = sides.astype(np.int64)
            cell = (cell[:, :, None] * count + sides[:, None]).reshape(len(states), -1)
            parts = np.concatenate([1 - share, share], axis=1)
            weight = (weight[:, :, None] * parts[:, None]).reshape(len(states), -1)
        return cell, weight
