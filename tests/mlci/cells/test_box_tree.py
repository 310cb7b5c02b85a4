"""Trees of boxes: the same as a grid where cells are equal, a partition of the space anywhere."""

import numpy as np
import pytest

import mlci
from mlci.cells.box_tree import LEAF, BoxTree
from mlci.cells.goal_cells import goal_tree
from mlci.maxent import TrajectoryDistribution

PENDULUM = mlci.Pendulum()
SPACE = PENDULUM.space
GRID = mlci.Grid(SPACE, (7, 6))
HYPOTHESES = mlci.Regions.from_grid(SPACE, (5, 5))
TASK = mlci.Task(np.array([1.0, 0.5]), mlci.Box.point([2.5, -0.4]), 4.0)


def states(count: int) -> np.ndarray:
    """Random states, some outside of the space, and some on borders of cells."""
    rng = np.random.default_rng(1)
    states = rng.uniform([-7, -6.5], [14, 6.5], (count, 2))
    states[: count // 4, 0] = rng.choice(GRID.corners[0][:, 0], count // 4)
    states[count // 8 : count // 3, 1] = rng.choice(GRID.corners[1][:, 1], count // 3 - count // 8)
    states[-1] = np.nan
    return states


def random_tree() -> BoxTree:
    """Cells that were halved at random, five times."""
    rng, tree = np.random.default_rng(2), goal_tree(mlci.Grid(SPACE, (2, 3)), [], np.ones(2))
    for _ in range(5):
        tree = tree.halved(rng.choice([LEAF, 0, 1], tree.size))
    return tree


def test_equal_cells_are_those_of_a_grid() -> None:
    tree = goal_tree(GRID, [], GRID.widths)
    assert tree.size == GRID.size
    number = GRID.index(tree.centers)  # of each cell of the tree
    assert np.array_equal(np.sort(number), np.arange(GRID.size))
    places = states(4000)
    found = tree.index(places)
    assert np.array_equal(np.where(found < 0, -1, number[found]), GRID.index(places))
    assert tree.corners[0] == pytest.approx(GRID.corners[0][number])
    assert tree.widths == pytest.approx(GRID.widths)
    assert tree.points_inside(3, np.arange(5)) == pytest.approx(GRID.points_inside(3, number[:5]))
    for lower, upper in (
        ([1.0, 0.5], [1.0, 0.5]),
        ([6.0, -1.0], [6.5, 1.1]),  # goes across the seam
        ([-np.inf, 6.0], [np.inf, 6.0]),
        ([1.0, 7.0], [1.0, 7.0]),  # outside
    ):
        region = mlci.Box(lower, upper)
        assert sorted(number[tree.cells_in(region)]) == GRID.cells_in(region).tolist()


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("exact_ends", [False, True])
def test_equal_cells_give_the_same_distribution(samples: int, exact_ends: bool) -> None:
    grid, actions = mlci.Grid(SPACE, (16, 16)), mlci.action_grid(PENDULUM, 5)
    found = []
    for cells in (grid, goal_tree(grid, [], grid.widths)):
        model = mlci.discretize(PENDULUM, cells, actions, 0.5, HYPOTHESES, samples=samples)
        task = TrajectoryDistribution.of_task(model, TASK, exact_ends=exact_ends)
        found.append((task.violation_probabilities(), task.log_z[0, task.start]))
    (phi, log_z), (of_tree, log_z_of_tree) = found
    assert np.mean(phi > 0.01) > 0.1
    assert of_tree == pytest.approx(phi, abs=1e-12)  # sums in another order
    assert log_z_of_tree == pytest.approx(log_z, abs=1e-11)


def test_cells_are_a_partition_of_the_space() -> None:
    tree = random_tree()
    assert np.sum(np.prod(tree.sides, axis=1)) == pytest.approx(np.prod(SPACE.bounds.widths))
    places = states(2000)
    lower, upper = tree.corners
    product = np.prod(upper - lower, axis=0) ** (1 / tree.size)  # the geometric mean
    assert tree.widths == pytest.approx(product)
    wrapped = SPACE.wrap(places)[:, None]
    top = (wrapped == SPACE.bounds.upper) & (upper == SPACE.bounds.upper)
    held = np.all((lower <= wrapped) & ((wrapped < upper) | top), axis=-1)
    assert np.array_equal(np.sum(held, axis=1), SPACE.contains(places))
    inside = SPACE.contains(places)
    assert np.array_equal(tree.index(places)[inside], np.argmax(held[inside], axis=1))
    assert np.all(tree.index(places[~inside]) == -1)


def test_two_arrays_are_the_whole_tree() -> None:
    tree = random_tree()
    again = BoxTree(SPACE, tree.dimension.tolist(), tree.position.tolist())
    assert np.array_equal(again.centers, tree.centers)


def test_a_tree_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="each split has two parts"):
        BoxTree(SPACE, [0, LEAF], [1.0, 0.0])
    with pytest.raises(ValueError, match="each split has two parts"):
        BoxTree(SPACE, [LEAF, LEAF], [0.0, 0.0])
    with pytest.raises(ValueError, match="each split has two parts"):
        BoxTree(SPACE, [], [])
    with pytest.raises(ValueError, match="split along 0 to 1"):
        BoxTree(SPACE, [2, LEAF, LEAF], [1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="a dimension and a position for each node"):
        BoxTree(SPACE, [0, LEAF, LEAF], [1.0])
    with pytest.raises(ValueError, match="node 1 is split outside of its box"):
        BoxTree(SPACE, [0, 0, LEAF, LEAF, LEAF], [1.0, 2.0, 0.0, 0.0, 0.0])


def test_what_needs_equal_cells_says_so() -> None:
    model = mlci.TabularModel(
        PENDULUM, random_tree(), mlci.action_grid(PENDULUM, 3), 0.5, HYPOTHESES
    )
    with pytest.raises(TypeError, match="needs a Grid of equal cells, not a BoxTree"):
        mlci.diagnose(model)
