"""Tabular models from arrays written by hand, over a line of cells whose dynamics do not matter."""

import itertools

import numpy as np
from scipy import sparse

from mlci.actuation.predicates import PairFunction
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.single_moves import SingleMoves
from mlci.spaces import Bools, Box, Floats, Ints, StateSpace
from mlci.systems import FunctionSystem
from mlci.tabular import TabularModel


def toy_model(successor: Ints, reward: Floats, allowed: Bools, crosses: Bools) -> TabularModel:
    """A model of S cells and M moves that cross C regions; `crosses` is (S * M, C)."""
    states, moves = successor.shape
    single = SingleMoves(np.where(allowed, successor, -1), reward, sparse.csr_matrix(crosses))
    space = StateSpace(Box([0.0], [states]), [False], ("place",))
    system = FunctionSystem(lambda x, u: (u[..., 0],), space, Box([-1.0], [1.0]))
    return TabularModel(
        system=system,
        grid=Grid(space, (states,)),
        actions=np.linspace(-1, 1, moves)[:, None],
        dt=1.0,
        regions=Regions.from_boxes(space, [Box([0.0], [states])] * crosses.shape[1]),
        kept=single,
    )


def toy_world() -> TabularModel:
    """Six cells, three moves of each, four regions that a move crosses rarely."""
    rng = np.random.default_rng(7)
    successor = rng.integers(0, 6, size=(6, 3))
    crosses = rng.random((18, 4)) < [0.05, 0.1, 0.15, 0.2]
    return toy_model(successor, rng.normal(size=(6, 3)), np.ones((6, 3), bool), crosses)


def every_trajectory(model: TabularModel, goal: int, steps: int) -> tuple[Bools, Floats]:
    """Which regions each trajectory from cell 0 crosses, and its probability, by listing them."""
    crosses = model.kept.crosses.toarray().reshape(model.states, model.moves, -1)
    crossed, weight = [], []
    for sequence in itertools.product(range(model.moves), repeat=steps):
        state, reward, row = 0, 0.0, np.zeros(len(model.regions), dtype=bool)
        for move in sequence:
            reward += model.kept.reward[state, move]
            row |= crosses[state, move]
            state = model.kept.successor[state, move]
        if state == goal:
            crossed.append(row)
            weight.append(np.exp(reward))
    return np.array(crossed), np.array(weight) / np.sum(weight)


def hard_push(above: float) -> PairFunction:
    """Pushes harder than some control, in any state."""
    return lambda states, controls: controls[..., 0] > above
