"""Tabular models from arrays written by hand, over a line of cells whose dynamics do not matter."""

import numpy as np
from scipy import sparse

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
