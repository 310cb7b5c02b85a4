"""Merged moves, against one cell and one move at a time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp

from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.systems import DoubleIntegrator, Pendulum
from mlci.tabular import TabularModel, action_grid, discretize


def of_cell(mdp: TabularModel, cell: int) -> dict[tuple[int, frozenset[int]], float]:
    """Its merged moves by where they lead and what they cross, with their weights."""
    merged = mdp.merged
    weights: dict[tuple[int, frozenset[int]], float] = {}
    for move in range(*merged.begins[cell : cell + 2]):
        regions = merged.crossing_region[slice(*merged.crossing_begins[move : move + 2])]
        key = (int(merged.successor[move]), frozenset(regions.tolist()))
        assert key not in weights
        weights[key] = float(merged.log_weight[move])
    return weights


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("at_once", [1, 40, 1 << 17])
def test_merged_moves_have_one_successor_and_the_same_regions(
    monkeypatch: pytest.MonkeyPatch, at_once: int, samples: int
) -> None:
    system = DoubleIntegrator()
    grid = Grid(system.space, (6, 5))
    regions = Regions.from_grid(system.space, (4, 3))
    mdp = discretize(system, grid, action_grid(system, 5), 0.8, regions, samples)
    crosses = mdp.kept.crosses.toarray().reshape(grid.size, mdp.moves, len(regions))
    monkeypatch.setattr("mlci.tabular._MOVES_AT_ONCE", at_once)
    assert not mdp.kept.allowed(mdp.truth).all()
    merged = 0
    for cell in range(grid.size):
        rewards: dict[tuple[int, frozenset[int]], list[float]] = {}
        for move in np.flatnonzero(mdp.kept.allowed(mdp.truth)[cell]):
            key = (
                int(mdp.kept.successor[cell, move]),
                frozenset(np.flatnonzero(crosses[cell, move]).tolist()),
            )
            rewards.setdefault(key, []).append(mdp.kept.reward[cell, move])
            merged += len(rewards[key]) > 1
        found = of_cell(mdp, cell)
        assert found.keys() == rewards.keys()
        for key, weight in found.items():
            assert weight == pytest.approx(logsumexp(rewards[key]), rel=1e-12, abs=1e-12)
    assert merged > 0


def test_a_cell_that_every_move_leaves_the_space_from_has_no_merged_move() -> None:
    system = DoubleIntegrator(control_limit=0.1)
    grid = Grid(system.space, (3, 3))
    regions = Regions.from_grid(system.space, (3, None))
    mdp = discretize(system, grid, action_grid(system, 3), 2.0, regions)
    stuck = ~mdp.kept.allowed(mdp.truth).any(axis=1)
    assert 0 < stuck.sum() < grid.size
    np.testing.assert_array_equal(np.diff(mdp.merged.begins) == 0, stuck)
    start = int(np.flatnonzero(stuck)[0])
    assert not TrajectoryDistribution(mdp, start, np.arange(grid.size), 1).is_possible


def test_forbidden_merged_moves_are_those_of_the_forbidden_moves() -> None:
    """Taken from the merged moves of the free model, or made anew from what is still allowed."""
    system = Pendulum()
    grid, actions = Grid(system.space, (8, 8)), action_grid(system, 3)
    regions = Regions.from_grid(system.space, (4, 4))
    mdp = discretize(system, grid, actions, 0.5, regions, samples=2)
    truth = regions.mask(["5", "6"])
    fresh = mdp.under(truth)
    assert "merged" not in vars(fresh)
    assert len(mdp.merged.successor) > 0
    derived = mdp.under(truth)
    assert derived.merged.successor is mdp.merged.successor
    crosses = mdp.kept.crosses.toarray().reshape(grid.size, mdp.moves, len(regions))
    for cell in range(grid.size):
        free = {key: w for key, w in of_cell(derived, cell).items() if w > -np.inf}
        assert of_cell(derived, cell) == of_cell(fresh, cell)
        assert free.keys() == {
            (int(mdp.kept.successor[cell, move]), frozenset(np.flatnonzero(crosses[cell, move])))
            for move in np.flatnonzero(fresh.kept.allowed(truth)[cell])
        }
    one, other = (TrajectoryDistribution(model, 3, 60, 6) for model in (derived, fresh))
    np.testing.assert_allclose(one.log_z, other.log_z, rtol=1e-12)
    assert one.is_possible
    np.testing.assert_allclose(
        one.violation_probabilities(), other.violation_probabilities(), rtol=1e-12, atol=1e-15
    )
