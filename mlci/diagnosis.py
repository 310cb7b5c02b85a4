"""How well a grid and a time step suit a system, as numbers, before anything long runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.special when it is first used

from mlci.cells.protocol import check_has_cells
from mlci.spaces import Floats
from mlci.tabular import TabularModel

# A discretisation is questioned above these shares. In the paper's sweep of the pendulum the truth
# is among the first 5 of most sets of 9 demonstrations where hardly a goal is out of reach, and of
# few where a sixth or more are. The latter have a frozen share of 0.34 or more, the former of 0.13
# or less, but for 5 actions on 1600 cells at 1 s: too few ways to go. Between these values the
# thresholds are a choice. No grid of that sweep loses half of its moves.
MOST_FROZEN, MOST_UNREACHABLE, MOST_LEAVING = 0.25, 0.05, 0.5


@dataclass(frozen=True)
class Diagnosis:
    """How well a grid and a time step suit a system, known before anything long runs.

    Attributes:
        stay: share of the moves that end in the cell they began in.
        leave: share of the moves that leave the state space.
        cells_crossed: mean number of cells that a move covers, in its fastest dimension.
        frozen: for each dimension, the share of cells whose number in it no move changes.
        noise: for each control u, var(u) dt of the tabular agent that holds an action for dt and
            has no goal: the mean over cells. Empty if it is not known.
        free_noise: the same without limits and steps of u; temperature / 2 for the reward -u^2,
            whatever dt is. NaN where the reward does not bound u.
    """

    stay: float
    leave: float
    cells_crossed: float
    frozen: tuple[float, ...]
    noise: tuple[float, ...] = ()
    free_noise: tuple[float, ...] = ()

    def concerns(self, names: Sequence[str], unreachable: int, tasks: int) -> list[str]:
        """What is wrong with the discretisation and what to do about it; empty if nothing is.

        Args:
            names: (n,) the state's dimensions.
            unreachable: tasks whose goal the tabular model cannot reach.
            tasks: number of tasks.
        """
        found = [
            f"in {share:.0%} of the cells no action changes the {name.replace('_', ' ')} cell "
            "within a step, so the tabular agent hardly steers"
            for share, name in zip(self.frozen, names, strict=True)
            if share > MOST_FROZEN
        ]
        if unreachable > MOST_UNREACHABLE * tasks:
            found.append(f"{unreachable} of {tasks} goals cannot be reached by the tabular agent")
        if found:
            frozen = max(self.frozen) > MOST_FROZEN
            ways = "a longer time step, more cells" if frozen else "more actions, a shorter step"
            found.append(
                f"remedy: {ways}, or start points averaged over the cell (transition.samples=3)"
            )
        if self.leave > MOST_LEAVING:
            found.append(
                f"{self.leave:.0%} of the moves leave the state space: widen its bounds or take "
                "a shorter time step"
            )
        return found


def diagnose(model: TabularModel) -> Diagnosis:
    """Measure how a tabular model moves; see `Diagnosis`.

    Raises:
        TypeError: a model without cells that all tasks share, or with cells that are not equal.
    """
    check_has_cells(model)
    grid, actions = model.equal_cells, model.actions
    stays, taken, crossed, changing = 0, 0, 0.0, np.zeros(len(grid.shape))
    for block in model.blocks():
        moves, cell = model.moves_of(block), block[:, None]
        speed = np.abs(model.system.dynamics(grid.centers[block, None, :], actions[None, :, :]))
        crossed += float(np.sum(np.max(speed * model.dt / grid.widths, axis=-1)))
        successor, allowed = moves.successor, moves.allowed(model.truth)
        taken += int(np.sum(allowed))
        stays += int(np.sum((successor == cell) & allowed))
        there = np.stack(np.unravel_index(np.maximum(successor, 0), grid.shape), axis=-1)
        here = np.stack(np.unravel_index(cell, grid.shape), axis=-1)
        changing += np.sum(np.any((there != here) & allowed[..., None], axis=1), axis=0)
    count = model.states * model.moves
    return Diagnosis(
        stay=stays / taken if taken else np.nan,
        leave=(count - taken) / count,
        cells_crossed=crossed / (grid.size * len(actions)),
        frozen=tuple(float(share) for share in (grid.size - changing) / grid.size),
        noise=tuple(_noise(model).tolist()),
        free_noise=tuple(_free_noise(model).tolist()),
    )


def _noise(model: TabularModel) -> Floats:
    """var(u) dt (m,) of an agent that takes actions with probabilities e^reward / Z, in a cell."""
    total = np.zeros(model.actions.shape[1])
    for block in model.blocks():
        centers, count = model.grid.centers[block], len(model.actions)
        reward = model.move_reward(
            np.repeat(centers, count, axis=0), np.tile(model.actions, (len(centers), 1))
        )
        probability = scipy.special.softmax(reward.reshape(-1, count), axis=1)
        mean = probability @ model.actions
        total += np.sum(probability @ np.square(model.actions) - np.square(mean), axis=0)
    return np.asarray(total * model.dt / model.grid.size)


def _free_noise(model: TabularModel) -> Floats:
    """var(u) dt (m,) of the Gaussian that the reward's curvature in u makes of e^reward."""
    n, box = model.grid.centers.shape[1], model.system.control_box
    middle = np.broadcast_to((box.lower + box.upper) / 2, (model.grid.size, box.dimension))
    _, hessian = model.system.reward_derivatives(model.grid.centers, middle)
    curvature = -np.mean(hessian[:, n:, n:], axis=0)  # of -reward
    if not np.all(np.linalg.eigvalsh(curvature) > 0):
        return np.full(box.dimension, np.nan)
    return np.asarray(model.temperature * np.diagonal(np.linalg.inv(curvature)))
