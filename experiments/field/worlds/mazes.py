"""Four mazes for a double integrator on a lattice: position and velocity, both whole numbers.

An acceleration of -1, 0 or 1 along each axis changes the velocity, which stays within -1 and 1, and
the velocity then changes the position: x' = x + v', v' = v + u. The state holds both, so that what
follows a move is certain.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from experiments.field.entries import Case, World
from experiments.field.worlds.grids import MOVES, certain_avoidance, violates
from mlci.rivals.agent import Agent
from mlci.rivals.problem import Problem, Shown
from mlci.worlds.tables import Table, TableRegion

STEPS, TEMPERATURE = 24, 1.0
ACCELERATIONS = np.vstack([[0, 0], MOVES])
VELOCITIES = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
EFFORT, STEP_COST = 0.5, 2.5  # [nat] of a squared unit of acceleration, and of a step

# s: start, g: goal, at rest; #: forbidden.
MAZES = {
    "maze 1": """
        s........
        .........
        ..#####..
        ..#####..
        .........
        .........
        ..#####..
        .........
        ........g""",
    "maze 2": """
        s...#....
        ....#....
        ....#....
        ....#....
        ....#....
        ....#....
        ....#....
        .........
        ........g""",
    "maze 3": """
        s........
        .........
        ######...
        .........
        .........
        .........
        ...######
        .........
        ........g""",
    "maze 4": """
        s...#....
        ....#....
        ..#.#.##.
        ..#......
        ..#......
        ..####...
        .........
        .........
        ........g""",
}


def maze(rows: list[str]) -> tuple[Table, np.ndarray]:
    """The world of a drawing, and which cells are forbidden."""
    drawing = np.array([list(row) for row in rows])
    shape = drawing.shape
    cells, speeds = drawing.size, len(VELOCITIES)
    place = np.stack(np.unravel_index(np.arange(cells), shape), axis=-1)
    velocity = VELOCITIES[:, None] + ACCELERATIONS  # (speeds, A, 2)
    after = place[:, None, None] + velocity
    on_grid = np.all((after >= 0) & (after < shape), axis=-1) & np.all(abs(velocity) <= 1, axis=-1)
    cell = after[..., 0] * shape[1] + after[..., 1]
    number = (velocity[..., 0] + 1) * 3 + velocity[..., 1] + 1
    successor = np.where(on_grid, cell * speeds + number, -1).reshape(cells * speeds, -1)
    rest = int(np.flatnonzero(~VELOCITIES.any(axis=1))[0])
    start, goal = (int(np.flatnonzero(drawing.ravel() == letter)[0]) for letter in "sg")
    cost = (STEP_COST + EFFORT * np.sum(ACCELERATIONS**2, axis=1)) / TEMPERATURE
    regions = {
        f"{c}": TableRegion(states=range(c * speeds, (c + 1) * speeds)) for c in range(cells)
    }
    table = Table.from_arrays(
        successor, -cost[None], start * speeds + rest, goal * speeds + rest, regions
    )
    return table, drawing.ravel() == "#"


def make(drawing: str, seed: int, count: int) -> Case:
    """Demonstrations of the maximum entropy agent under the truth."""
    rows = drawing.split()
    table, truth = maze(rows)
    agent = Agent(table, STEPS, final=table.goals)
    paths = agent.under(truth).sample(count, np.random.default_rng(seed))
    beside, speeds = certain_avoidance(table, STEPS), len(VELOCITIES)
    shown = [Shown(agent, p.states, p.actions, violates(table, p), beside) for p in paths]
    shape = len(rows), len(rows[0])
    inside = np.repeat(np.eye(len(truth), dtype=bool), speeds, axis=0)
    places = np.stack(np.unravel_index(np.arange(len(truth)), shape), axis=-1).astype(float)
    problem = Problem(tuple(shown), shape, inside, np.repeat(places, speeds, axis=0))
    return Case(problem, truth.astype(float), np.asarray(table.crosses @ truth > 0))


WORLDS = {
    name: World(
        make=partial(make, drawing),
        demonstrations=20,
        source="our own",
        setting=f"horizon {STEPS} moves or until the goal at rest, temperature {TEMPERATURE:g}, no "
        "discount; hard: no position inside, whatever the velocity",
        differs="nothing is published of it",
    )
    for name, drawing in MAZES.items()
}
