"""The 9 x 9 grid of Scobee and Sastry (2020): states, actions and two features are hypotheses."""

from __future__ import annotations

import numpy as np

from experiments.field.entries import Case, World
from experiments.field.worlds.grids import certain_avoidance, violates
from mlci.rivals.agent import Agent
from mlci.rivals.problem import Problem, Shown
from mlci.worlds.tables import Table, TableRegion

SIDE, STEPS, COST = 9, 30, -4.0  # states a side, moves at most, reward of a move [nat]
START, GOAL = 0, 8
# Right and up of the eight actions, in the order of their code.
RIGHT, UP = np.array([-1, 1, 0, 0, -1, 1, -1, 1]), np.array([0, 0, 1, -1, 1, 1, -1, -1])
FEATURES = {"green": [4, 13, 22], "blue": [58, 67, 76]}
TRUTH = ["action 5", "green", "state 31", "state 39", "state 47"]


def grid() -> Table:
    """The world: state 9 y + x, and moves that stay on the grid."""
    y, x = np.divmod(np.arange(SIDE**2)[:, None], SIDE)
    column, row = x + RIGHT, y + UP
    on_grid = (column >= 0) & (column < SIDE) & (row >= 0) & (row < SIDE)
    regions = {f"state {s}": TableRegion(states=[s]) for s in range(SIDE**2)}
    regions |= {f"action {a}": TableRegion(actions=[a]) for a in range(len(UP))}
    regions |= {name: TableRegion(states=states) for name, states in FEATURES.items()}
    return Table.from_arrays(np.where(on_grid, SIDE * row + column, -1), COST, START, GOAL, regions)


def make(seed: int, count: int) -> Case:
    """Demonstrations of the maximum entropy agent under the truth."""
    table = grid()
    agent = Agent(table, STEPS, final=table.goals)
    truth = table.mask(TRUTH)
    paths = agent.under(truth).sample(count, np.random.default_rng(seed))
    beside = certain_avoidance(table, STEPS)
    shown = [Shown(agent, p.states, p.actions, violates(table, p), beside) for p in paths]
    inside = np.zeros((SIDE**2, len(table.regions)), dtype=bool)
    for number, region in enumerate(table.regions.values()):
        inside[np.array(region.states, dtype=np.int64), number] = True
    places = np.stack(np.divmod(np.arange(SIDE**2), SIDE), axis=-1).astype(float)
    problem = Problem(tuple(shown), (SIDE, SIDE), inside, places)
    return Case(problem, truth.astype(float), np.asarray(table.crosses @ truth > 0))


WORLDS = {
    "Scobee and Sastry": World(
        make=make,
        demonstrations=20,
        source="Scobee and Sastry, Maximum Likelihood Constraint Inference for Inverse "
        "Reinforcement Learning, ICLR 2020",
        setting=f"horizon {STEPS} moves or until the goal, temperature 1, reward {COST:g} a move, "
        "no discount; hard: no move into, out of or by what is forbidden",
        differs="their text leaves the truth of the grid to a figure; ours is the five constraints "
        "whose selection from their one demonstration lowers KL by more than 4 nat; paths end by "
        f"move {STEPS}, where theirs have no limit",
    )
}
