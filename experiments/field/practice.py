"""Worlds to try methods in before the benchmark: each seed draws a layout that no world of it has.

    python -m experiments.field --add experiments/field/practice.py --worlds "practice maze" ...

What our methods leave open was settled in these worlds; see README.md.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from experiments.field.entries import Case, World
from experiments.field.worlds import mazes, pendulums, plane, walls
from experiments.field.worlds.grids import entering, grid_case, successors
from mlci.regions import Regions
from mlci.rivals.agent import Agent
from mlci.shapes.balls import Ball
from mlci.spaces import Bools
from mlci.worlds.tables import Table

Layout = Callable[[np.random.Generator], Bools]


def blocks(shape: tuple[int, int], rng: np.random.Generator) -> Bools:
    """Two rectangles at random, the corners of the grid left free."""
    forbidden = np.zeros(shape, dtype=bool)
    for _ in range(2):
        height, width = rng.permutation([rng.integers(1, 4), rng.integers(2, 6)])
        row, column = rng.integers(0, shape[0] - height + 1), rng.integers(0, shape[1] - width + 1)
        forbidden[row : row + height, column : column + width] = True
    forbidden[[0, 0, -1, -1], [0, -1, 0, -1]] = False
    return forbidden


def scattered(shape: tuple[int, int], rng: np.random.Generator) -> Bools:
    """Six states at random, no corner among them."""
    forbidden = np.zeros(shape, dtype=bool)
    forbidden.flat[rng.choice(np.arange(1, forbidden.size - 1), 6, replace=False)] = True
    forbidden[[0, -1], [-1, 0]] = False
    return forbidden


def first_that_matters(make: Callable[[Bools], Case], layout: Layout, seed: int) -> Case:
    """The first layout with a way round, which an agent who knows of nothing mostly enters."""
    rng = np.random.default_rng([seed, 7])
    while True:
        truth = layout(rng)
        try:
            case = make(truth)
        except ValueError:  # no way round
            continue
        ((agent, _),) = case.problem.tasks
        if agent.keeps_out(case.forbidden) < 0.5:
            return case


def in_maze(layout: Callable[..., Bools], seed: int, count: int) -> Case:
    """The double integrator of the mazes, from corner to corner."""

    def make(truth: Bools) -> Case:
        drawing = np.where(truth, "#", ".")
        drawing[0, 0], drawing[-1, -1] = "s", "g"
        return mazes.make("\n".join("".join(row) for row in drawing), seed, count)

    return first_that_matters(make, partial(layout, (9, 9)), seed)


def slipping(layout: Callable[..., Bools], seed: int, count: int) -> Case:
    """The slippery states of the walls, 7 x 7, from corner to corner."""

    def make(truth: Bools) -> Case:
        forbidden = [(int(i), int(j)) for i, j in np.argwhere(truth)]
        return walls.slip_case((7, 7), (6, 6), forbidden, seed, count)

    return first_that_matters(make, partial(layout, (7, 7)), seed)


def certain(layout: Callable[..., Bools], seed: int, count: int) -> Case:
    """Eight certain moves of cost 2 nat in 9 x 9 states, from corner to corner."""
    meant = successors((9, 9))
    regions = entering(meant, np.arange(81)[:, None])
    table = Table.from_arrays(meant, -2.0, start=0, goals=80, regions=regions)
    agent = Agent(table, 24, final=table.goals)

    def make(truth: Bools) -> Case:
        return grid_case(agent, (9, 9), np.flatnonzero(truth).tolist(), seed, count)

    return first_that_matters(make, partial(layout, (9, 9)), seed)


def plane_case(seed: int, count: int) -> Case:
    """The point in the plane, and one or two ellipses at random."""
    rng = np.random.default_rng([seed, 7])
    balls = [Ball(rng.uniform(-1.5, 1.5, 2), rng.uniform(0.4, 1.0, 2)) for _ in range(2)]
    truth = Regions.from_shapes(plane.POINT.space, balls, ("first", "second"))
    return plane.between(truth, seed, count)


_SAID = ("our own", "as the worlds of the benchmark that it is like", "a layout by each seed")
WORLDS = {
    "practice maze": World(partial(in_maze, blocks), 20, *_SAID),
    "practice maze, scattered": World(partial(in_maze, scattered), 20, *_SAID),
    "practice walls": World(partial(slipping, blocks), 20, *_SAID),
    "practice walls, scattered": World(partial(slipping, scattered), 20, *_SAID),
    "practice states": World(partial(certain, blocks), 20, *_SAID),
    "practice states, scattered": World(partial(certain, scattered), 20, *_SAID),
    "practice plane": World(plane_case, 16, *_SAID),
    "practice pendulum": World(partial(pendulums.make, "practice"), 20, *_SAID),
}
