"""Moves that nothing tells apart, taken together, against one cell and one move at a time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp

from mlci.grids import Grid
from mlci.maxent import log_partition, violation_probabilities
from mlci.regions import ConstraintSet
from mlci.systems import DoubleIntegrator, Pendulum
from mlci.tabular import TabularMDP, action_grid, discretize, forbid


def of_cell(mdp: TabularMDP, cell: int) -> dict[tuple[int, frozenset[int]], float]:
    """Its ways by where they lead and what they cross, with their weights."""
    ways = mdp.ways
    entries = slice(*ways.crossing_begins[cell : cell + 2])
    certain = ways.certain_region[slice(*ways.certain_begins[cell : cell + 2])]
    found = {}
    for way in range(*ways.begins[cell : cell + 2]):
        mine = ways.crossing_region[entries][ways.crossing_way[entries] == way]
        assert not set(mine) & set(certain)
        key = (int(ways.successor[way]), frozenset([*mine.tolist(), *certain.tolist()]))
        assert key not in found
        found[key] = float(ways.log_weight[way])
    return found


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("at_once", [1, 40, 1 << 17])
def test_ways_are_the_moves_of_one_successor_and_the_same_regions(
    monkeypatch: pytest.MonkeyPatch, at_once: int, samples: int
) -> None:
    system = DoubleIntegrator()
    grid = Grid(system.space, (6, 5))
    regions = ConstraintSet.from_grid(system.space, (4, 3))
    mdp = discretize(system, grid, action_grid(system, 5), 0.8, regions, samples)
    crosses = mdp.crosses.toarray().reshape(grid.size, mdp.moves, len(regions))
    monkeypatch.setattr("mlci.tabular._MOVES_AT_ONCE", at_once)
    assert not mdp.allowed.all()
    merged = 0
    for cell in range(grid.size):
        rewards: dict[tuple[int, frozenset[int]], list[float]] = {}
        for move in np.flatnonzero(mdp.allowed[cell]):
            key = (
                int(mdp.successor[cell, move]),
                frozenset(np.flatnonzero(crosses[cell, move]).tolist()),
            )
            rewards.setdefault(key, []).append(mdp.reward[cell, move])
            merged += len(rewards[key]) > 1
        found = of_cell(mdp, cell)
        assert found.keys() == rewards.keys()
        for key, weight in found.items():
            assert weight == pytest.approx(logsumexp(rewards[key]), rel=1e-12, abs=1e-12)
    assert merged > 0
    assert len(mdp.ways.certain_region) > 0


def test_a_cell_that_every_move_leaves_the_space_from_has_no_way() -> None:
    system = DoubleIntegrator(control_limit=0.1)
    grid = Grid(system.space, (3, 3))
    regions = ConstraintSet.from_grid(system.space, (3, None))
    mdp = discretize(system, grid, action_grid(system, 3), 2.0, regions)
    stuck = ~mdp.allowed.any(axis=1)
    assert 0 < stuck.sum() < grid.size
    np.testing.assert_array_equal(np.diff(mdp.ways.begins) == 0, stuck)
    start = int(np.flatnonzero(stuck)[0])
    assert log_partition(mdp, start, np.arange(grid.size), 1)[0, start] == -np.inf


def test_forbidden_ways_are_those_of_the_forbidden_moves() -> None:
    """Taken from the ways of the free model, or made anew from what is still allowed."""
    system = Pendulum()
    grid, actions = Grid(system.space, (8, 8)), action_grid(system, 3)
    regions = ConstraintSet.from_grid(system.space, (4, 4))
    mdp = discretize(system, grid, actions, 0.5, regions, samples=2)
    fresh = forbid(mdp, [5, 6])
    assert "ways" not in vars(fresh)
    assert len(mdp.ways.successor) > 0
    kept = forbid(mdp, [5, 6])
    assert kept.ways.successor is mdp.ways.successor
    for cell in range(grid.size):
        free = {key: w for key, w in of_cell(kept, cell).items() if w > -np.inf}
        assert free == of_cell(fresh, cell)
    start, goal = 3, 60
    log_z = log_partition(kept, start, goal, 6)
    np.testing.assert_allclose(log_z, log_partition(fresh, start, goal, 6), rtol=1e-12)
    assert log_z[0, start] > -np.inf
    np.testing.assert_allclose(
        violation_probabilities(kept, log_z, start),
        violation_probabilities(fresh, log_z, start),
        rtol=1e-12,
        atol=1e-15,
    )
