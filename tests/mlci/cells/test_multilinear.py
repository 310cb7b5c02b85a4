"""Moves that are shared among the cells around their ends."""

import itertools

import numpy as np
import pytest

import mlci
from mlci.cells.goal_cells import goal_tree
from mlci.cells.multilinear import MultilinearModel
from mlci.maxent import TrajectoryDistribution

PENDULUM = mlci.Pendulum()
HYPOTHESES = mlci.Regions.from_grid(PENDULUM.space, (3, 3))
ACTIONS = mlci.action_grid(PENDULUM, 3)


def model(shape: tuple[int, int], offset: tuple[float, float] = (0.0, 0.0)) -> MultilinearModel:
    grid = mlci.Grid(PENDULUM.space, shape, offset)
    return MultilinearModel(PENDULUM, grid, ACTIONS, 0.4, HYPOTHESES)


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.3, 0.0)])
def test_the_mean_of_where_a_move_leads_is_its_end(offset: tuple[float, float]) -> None:
    shared = model((9, 8), offset)
    cells = np.arange(shared.states)
    moves = shared.moves_of(cells)
    shape = len(cells), len(ACTIONS), 4
    successor = moves.successor.reshape(shape)
    origin = shared.grid.centers[:, None]
    weight = np.where(successor >= 0, np.exp(moves.reward.reshape(shape)), 0.0)
    weight /= np.exp(shared.move_reward(origin, ACTIONS))[..., None]
    ends = mlci.rollout(PENDULUM, origin, ACTIONS[:, None, :], 0.4, shared.substeps)[..., -1, :]
    apart = PENDULUM.space.difference(shared.grid.centers[successor], ends[:, :, None])
    inner = np.abs(ends[..., 1]) < 6 - shared.grid.widths[1] / 2  # between outermost centres
    assert np.mean(inner) > 0.7
    assert np.sum(weight, axis=-1)[inner] == pytest.approx(1.0)
    mean = np.sum(weight[..., None] * apart, axis=-2)
    assert mean[inner] == pytest.approx(0.0, abs=1e-12)
    variance = np.sum(weight[..., None] * np.square(apart), axis=-2)[inner]
    assert np.all(variance <= shared.grid.widths**2 / 4 + 1e-12)


def test_z_and_phi_are_sums_over_all_trajectories() -> None:
    shared = model((5, 4))
    start, goal, steps = 6, 12, 3
    moves = shared.moves_of(np.arange(shared.states))
    crosses = moves.crosses.toarray().reshape(shared.states, shared.moves, -1)
    total, avoided = 0.0, np.zeros(len(HYPOTHESES))
    for way in itertools.product(range(shared.moves), repeat=steps):
        cell, reward, crossed = start, 0.0, np.zeros(len(HYPOTHESES), dtype=bool)
        for move in way:
            reward += moves.reward[cell, move]
            crossed |= crosses[cell, move]
            cell = moves.successor[cell, move]
            if cell < 0:
                break
        if cell == goal:
            total += np.exp(reward)
            avoided += np.exp(reward) * ~crossed
    task = TrajectoryDistribution(shared, start, np.array([goal]), steps)
    assert total > 0
    assert task.log_z[0, start] == pytest.approx(np.log(total))
    assert task.avoidance_probabilities() == pytest.approx(avoided / total)
    cells, taken = task.sample(20, np.random.default_rng(0))
    assert np.all(cells[:, -1] == goal)
    assert taken.max() < shared.moves


def test_exact_ends_begin_at_centres() -> None:
    shared = model((9, 8))
    task = mlci.Task(np.array([1.0, 0.5]), mlci.Box.point([2.0, 0.5]), 2.0)
    phi = TrajectoryDistribution.of_task(shared, task, exact_ends=True).violation_probabilities()
    assert phi[HYPOTHESES.violated_by(np.array([[1.0, 0.5], [1.0, 0.5]]))] == pytest.approx(1.0)
    origins = shared.move_origins(np.array([3, 5]), np.array([0, 11]))
    assert np.array_equal(origins, shared.grid.centers[[3, 5]])


def test_other_start_points_and_cells_are_refused() -> None:
    grid = mlci.Grid(PENDULUM.space, (5, 4))
    with pytest.raises(ValueError, match="samples must be 1, not 2"):
        MultilinearModel(PENDULUM, grid, ACTIONS, 0.4, HYPOTHESES, samples=2)
    tree = goal_tree(grid, [], grid.widths)
    with pytest.raises(TypeError, match="needs a Grid of equal cells"):
        MultilinearModel(PENDULUM, tree, ACTIONS, 0.4, HYPOTHESES)
