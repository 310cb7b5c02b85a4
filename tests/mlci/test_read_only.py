"""Arrays that cannot be written to, as memory maps and data frames give them, are taken as any."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import sparse

from mlci.control.ilqr import optimize
from mlci.demonstrations import Demonstration, Task
from mlci.grids import Grid
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.safety.constant_controls import escape_value
from mlci.safety.reachability import SafeSet
from mlci.single_moves import SingleMoves
from mlci.spaces import Box
from mlci.systems import DoubleIntegrator
from mlci.tabular import discretize
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.tables import Table

Fixed = Callable[[Any], Any]  # gives an array with these values, which can or cannot be written to
SYSTEM = DoubleIntegrator()
PATH = np.linspace([-1.0, 0.0], [0.5, 1.0], 9)


def regions(fixed: Fixed) -> Regions:
    """Twelve cells of the double integrator's space."""
    cells = Regions.from_grid(SYSTEM.space, (4, 3))
    return Regions.from_boxes(
        SYSTEM.space,
        [Box(fixed(cells.box(i).lower), fixed(cells.box(i).upper)) for i in range(len(cells))],
    )


def _violated(fixed: Fixed) -> Any:
    return regions(fixed).violated_by(fixed(PATH))


def _inferred(fixed: Fixed) -> Any:
    model = discretize(
        SYSTEM, Grid(SYSTEM.space, (7, 6)), fixed([[-1.0], [1.0]]), 0.5, regions(fixed)
    )
    task = Task(fixed(PATH[0]), Box.point(fixed(PATH[-1])), 2.0)
    path = Demonstration(task, fixed(PATH), None, fixed(np.linspace(0, 2, 9)))
    return infer(model, [path]).evidence


def _kept(fixed: Fixed) -> Any:
    model = discretize(SYSTEM, Grid(SYSTEM.space, (7, 6)), [[-1.0], [1.0]], 0.5, regions(fixed))
    kept = model.kept
    assert kept is not None
    crosses = sparse.csr_matrix(
        tuple(map(fixed, (kept.crosses.data, kept.crosses.indices, kept.crosses.indptr))),
        shape=kept.crosses.shape,
    )
    moves = SingleMoves(fixed(kept.successor), fixed(kept.reward), crosses)
    return replace(model, kept=moves).merged.log_weight


def _of_table(fixed: Fixed) -> Any:
    successor = fixed([[1, -1], [2, 0], [-1, 1]])
    table = Table.from_arrays(successor, fixed([[-0.5], [-1.0], [-2.0]]), 0, 2)
    return FixedHorizon(table, 4).log_z


def _safe(fixed: Fixed) -> Any:
    grid = Grid(SYSTEM.space, (7, 6))
    safe = SafeSet.from_values(grid, fixed(grid.centers[:, 0]))
    return safe.value(fixed(PATH))


def _escapes(fixed: Fixed) -> Any:
    return escape_value(SYSTEM, regions(fixed).select(np.arange(12) == 3), fixed(PATH), 1.0, 0.1)


def _optimum(fixed: Fixed) -> Any:
    start, goal = fixed(PATH[:1]), fixed(PATH[-1:])
    guess = fixed(np.zeros((1, 5, 1)))
    return optimize(SYSTEM, start, goal, goal, guess, 0.1, iterations=3).controls


@pytest.mark.parametrize(
    "answer", [_violated, _inferred, _kept, _of_table, _safe, _escapes, _optimum]
)
def test_answers_are_the_same(answer: Callable[[Fixed], Any]) -> None:
    def fixed(values: Any) -> Any:
        array = np.array(values)
        array.flags.writeable = False
        return array

    def apart(values: Any) -> Any:  # in every other place of memory
        array = np.array(values)
        room = np.zeros((*array.shape, 2), dtype=array.dtype)
        room[..., 0] = array
        return room[..., 0]

    expected = answer(np.array)
    np.testing.assert_array_equal(answer(fixed), expected)
    np.testing.assert_array_equal(answer(apart), expected)
