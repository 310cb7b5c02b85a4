"""Walls of 7 x 7 states with slippery moves, S1 to S4, and corridors of 10 x 8 states."""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np

from experiments.field.entries import Case, World
from experiments.field.worlds.grids import entering, grid_case, slippery, successors
from mlci.rivals.agent import Agent
from mlci.worlds.tables import Table

SLIP, TEMPERATURE, DISCOUNT, STEPS = 0.05, 0.01, 0.95, 30

# Goal and forbidden states as (row, column); the start is (0, 0).
WALLS = {
    "walls S1": ((6, 6), [*product([2], range(5)), *product([4], range(2, 7))]),
    "walls S2": ((6, 6), list(product(range(1, 6), range(1, 6)))),
    "walls S3": ((6, 0), list(product([3], range(5)))),
    "walls S4": ((6, 6), list(product(range(2, 5), range(2, 5)))),
}
# Three corridors of 10 x 8 states, joined at alternating ends; the shortest way breaks both walls.
CORRIDORS = ((9, 7), [*product([3], range(7)), *product([6], range(1, 8))])


def slip_case(
    shape: tuple[int, int],
    goal: tuple[int, int],
    forbidden: list[tuple[int, int]],
    seed: int,
    count: int,
) -> Case:
    """An agent in a world that slips, whose only reward is 1 at the goal."""
    meant = successors(shape)
    end = goal[0] * shape[1] + goal[1]
    chances = slippery(meant, SLIP)
    table = Table.from_arrays(
        chances,
        chances[:, :, end] / TEMPERATURE,
        start=0,
        goals=end,
        regions=entering(meant, np.arange(len(meant))[:, None]),
    )
    numbers = [row * shape[1] + column for row, column in forbidden]
    return grid_case(Agent(table, STEPS, DISCOUNT), shape, numbers, seed, count)


_SETTING = (
    f"horizon {STEPS} moves or until the goal, temperature {TEMPERATURE:g}, discount {DISCOUNT:g}; "
    "hard: no move that is meant to enter, slips are free"
)
WORLDS = {
    name: World(
        make=partial(slip_case, (7, 7), goal, forbidden),
        demonstrations=20,
        source="7 x 7 walls with eight slippery moves, as the literature on chance-constrained "
        "inverse constraint learning describes them",
        setting=_SETTING,
        differs="a slip off the grid is removed and the rest scaled; temperature and horizon are "
        "ours; a path that slips into a wall is shown, and breaks nothing",
    )
    for name, (goal, forbidden) in WALLS.items()
} | {
    "corridors": World(
        make=partial(slip_case, (10, 8), *CORRIDORS),
        demonstrations=20,
        source="our own: 10 x 8 corridors with the slips of the walls",
        setting=_SETTING,
        differs="nothing is published of it: our layout",
    )
}
