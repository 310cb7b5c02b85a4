"""Tables whose distributions others published, and small random ones."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np

from mlci.worlds.tables import Table, TableRegion

# Actions of the grid: left, right, up, down, and the four diagonal ones.
_RIGHT, _UP = np.array([-1, 1, 0, 0, -1, 1, -1, 1]), np.array([0, 0, 1, -1, 1, 1, -1, -1])


def grid_world(
    side: int, goal: int, reward: float = -4.0, regions: Mapping[str, TableRegion] | None = None
) -> Table:
    """Scobee and Sastry's grid: state side * y + x, start 0, moves that stay on the grid."""
    y, x = np.divmod(np.arange(side**2)[:, None], side)
    column, row = x + _RIGHT, y + _UP
    on_grid = (column >= 0) & (column < side) & (row >= 0) & (row < side)
    successor = np.where(on_grid, side * row + column, -1)
    return Table.from_arrays(successor, reward, 0, goal, regions)


def published_grid() -> Table:
    """The 9 x 9 grid of their paper with its hypotheses: states, actions and two features."""
    regions = {f"state {s}": TableRegion(states=[s]) for s in range(81)}
    regions |= {f"action {a}": TableRegion(actions=[a]) for a in range(8)}
    regions["green"] = TableRegion(states=[4, 13, 22])
    regions["blue"] = TableRegion(states=[58, 67, 76])
    return grid_world(9, goal=8, regions=regions)


def chancy_world() -> Table:
    """A world of 5 states and 3 actions in which chance decides."""
    chances = np.zeros((5, 3, 5))
    chances[0, 0, [1, 2]] = 0.9, 0.1
    chances[0, 1, 3] = 1.0
    chances[0, 2, [1, 2]] = 0.1, 0.9
    chances[1:3, 0, 3], chances[1:3, 0, 4] = 0.05, 0.95
    chances[1:3, 1, 3] = chances[1:3, 2, 4] = 1.0
    chances[3, :, 4] = chances[4, :, 0] = 1.0
    reward = np.array([1.0, 2.0, 2.0, -20.0, 3.0])[:, None]
    return Table.from_arrays(chances, reward, [0.5, 0, 0, 0, 0.5])


def random_table(
    rng: np.random.Generator, states: int, actions: int, regions: int = 0, cost: float = 3.0
) -> Table:
    """A table of certain moves, some missing, with random regions and its goal the last state."""
    successor = rng.integers(0, states, size=(states, actions))
    successor[rng.random(successor.shape) < 0.1] = -1
    named = {
        f"region {i}": TableRegion(
            states=rng.choice(np.arange(1, states - 1), size=i % 2 + 1),
            moves=[(int(rng.integers(states)), int(rng.integers(actions)))],
        )
        for i in range(regions)
    }
    reward = -cost * rng.uniform(0.5, 1.5, size=successor.shape)
    return Table.from_arrays(successor, reward, 0, states - 1, named)


def trajectories(table: Table, steps: int) -> list[tuple[float, list[int], list[int]]]:
    """Weight, states and rows of moves of every trajectory from 0, up to the goal at the latest."""
    everything = []
    goals = set(table.goals.tolist())
    for length in range(1, steps + 1):
        for actions in product(range(table.actions), repeat=length):
            states, rows, reward = [0], [], 0.0
            for action in actions:
                if not table.allowed[states[-1], action]:
                    break
                reward += table.reward[states[-1], action]
                rows.append(states[-1] * table.actions + action)
                states.append(int(table.successor[states[-1], action]))
            whole = len(rows) == length and (states[-1] in goals or not goals)
            if whole and (goals or length == steps):
                everything.append((float(np.exp(reward)), states, rows))
    return everything
