"""Each goal is in the middle of its cell."""

import numpy as np
import pytest

import mlci
from mlci.cells.goal_cells import goal_tree

SPACE = mlci.Pendulum().space
GRID = mlci.Grid(SPACE, (8, 8))


def test_points_are_in_the_middle_of_cells_of_a_width() -> None:
    points = np.random.default_rng(3).uniform([0.3, -5], [6.0, 5], (4, 2))
    tree = goal_tree(GRID, [mlci.Box.point(point) for point in points], GRID.widths / 4)
    cell = tree.index(points)
    assert tree.centers[cell] == pytest.approx(points)
    assert tree.sides[cell] == pytest.approx(np.tile(GRID.widths / 4, (4, 1)))
    assert np.sum(np.prod(tree.sides, axis=1)) == pytest.approx(np.prod(SPACE.bounds.widths))
    assert np.all(tree.sides <= GRID.widths * (1 + 2 * 0.3) + 1e-12)  # elsewhere as the grid's


def test_near_a_border_a_cell_is_narrower_and_at_the_border_begins_there() -> None:
    width = GRID.widths / 2
    near, at = np.array([0.4 * width[0], 1.0]), np.array([3.0, 6.0])
    tree = goal_tree(GRID, [mlci.Box.point(near), mlci.Box.point(at)], width)
    cells = tree.index([near, at])
    assert tree.centers[cells[0]] == pytest.approx(near)
    assert tree.sides[cells[0]] == pytest.approx([0.8 * width[0], width[1]])
    assert tree.corners[1][cells[1]][1] == 6.0
    assert tree.sides[cells[1]] == pytest.approx([width[0], width[1] / 2])


def test_a_goal_with_sides_is_cut_out_along_them() -> None:
    goal = mlci.Box([1.1, -np.inf], [1.3, np.inf])
    tree = goal_tree(GRID, [goal], GRID.widths)
    lower, upper = tree.corners
    inside = tree.cells_in(goal)
    assert np.min(lower[inside, 0]) == 1.1
    assert np.max(upper[inside, 0]) == 1.3
    assert len(inside) == 8  # along its free dimension as ever


def test_goals_that_overlap_or_lie_outside_leave_a_tree() -> None:
    points = [[3.0, 1.0], [3.1, 1.1], [3.05, 0.9], [3.0, 8.0]]
    tree = goal_tree(GRID, [mlci.Box.point(point) for point in points], GRID.widths)
    assert np.sum(np.prod(tree.sides, axis=1)) == pytest.approx(np.prod(SPACE.bounds.widths))


def test_shifted_cells_are_refused() -> None:
    with pytest.raises(ValueError, match="a grid without offset"):
        goal_tree(mlci.Grid(SPACE, (8, 8), (0.5, 0.0)), [], GRID.widths)
