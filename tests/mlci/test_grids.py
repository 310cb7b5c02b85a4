import tracemalloc

import numpy as np
import pytest

from mlci.grids import Grid
from mlci.spaces import Box, StateSpace

LOWER, UPPER = np.array([-1.0, 0.0, -2.0, 10.0]), np.array([5.0, 3.0, 2.0, 11.0])
PERIODIC = np.array([True, False, True, False])
SHAPES = [(7,), (6, 5), (4, 5, 3), (3, 4, 2, 3), (1, 4), (8, 1)]


def grid_of(shape: tuple[int, ...]) -> Grid:
    n = len(shape)
    names = tuple("abcd"[:n])
    return Grid(StateSpace(Box(LOWER[:n], UPPER[:n]), PERIODIC[:n], names), shape)


def random_states(grid: Grid, count: int, beyond: float = 0.0) -> np.ndarray:
    """States in the bounds, or as far as `beyond` of a width outside of them."""
    bounds = grid.space.bounds
    margin = beyond * bounds.widths
    return np.random.default_rng(0).uniform(
        bounds.lower - margin, bounds.upper + margin, size=(count, bounds.dimension)
    )


@pytest.mark.parametrize("shape", SHAPES)
def test_index_is_the_nearest_centre(shape):
    grid = grid_of(shape)
    states = random_states(grid, 500, beyond=0.3)
    to_centers = grid.space.difference(grid.centers, states[:, None, :]) / grid.widths
    nearest = np.argmin(np.max(np.abs(to_centers), axis=-1), axis=-1)
    expected = np.where(grid.space.contains(states), nearest, -1)
    np.testing.assert_array_equal(grid.index(states), expected)


@pytest.mark.parametrize("shape", SHAPES)
def test_cells_are_numbered_in_c_order_of_their_centres(shape):
    grid = grid_of(shape)
    assert grid.centers.shape == (grid.size, len(shape))
    np.testing.assert_array_equal(grid.index(grid.centers), np.arange(grid.size))
    numbers = np.arange(grid.size).reshape(shape)
    for d in range(len(shape)):
        along = np.moveaxis(grid.centers[numbers][..., d], d, -1)
        np.testing.assert_allclose(along, np.broadcast_to(grid.axes[d], along.shape))


def test_bounds_belong_to_the_grid_and_what_lies_beyond_does_not():
    grid = grid_of((6, 5))
    states = [[-1, 0], [-1, 3], [5, 0], [4.999, 3], [0, 3.001], [0, -0.001], [0, np.nan]]
    np.testing.assert_array_equal(grid.index(states), [0, 4, 0, 29, -1, -1, -1])


@pytest.mark.parametrize("samples", [1, 2, 3])
@pytest.mark.parametrize("shape", SHAPES)
def test_points_inside_are_the_centres_of_a_finer_grid(shape, samples):
    grid = grid_of(shape)
    finer = Grid(grid.space, tuple(samples * count for count in shape))
    points = grid.points_inside(samples)
    assert points.shape == (grid.size, samples ** len(shape), len(shape))
    np.testing.assert_array_equal(
        grid.index(points), np.repeat(np.arange(grid.size)[:, None], points.shape[1], axis=1)
    )
    met = finer.index(points).ravel()
    np.testing.assert_array_equal(np.sort(met), np.arange(finer.size))
    np.testing.assert_allclose(points.reshape(-1, len(shape)), finer.centers[met], atol=1e-12)


@pytest.mark.parametrize(
    ("lower", "upper", "rows", "columns"),
    [
        # Unit cells from -1 to 5 in a periodic dimension, cells of 0.6 from 0 to 3 in the other.
        ([2.3, 1.0], [2.3, 1.0], [3], [1]),  # a point
        ([8.3, 1.0], [8.3, 1.0], [3], [1]),  # the same point, a turn later
        ([0.4, 0.2], [2.6, 1.0], [1, 2, 3], [0, 1]),
        ([0.9, 0.2], [2.1, 1.2], [1, 2, 3], [0, 1]),  # corners of cells are enough, edges are not
        ([2.3, 1.4], [2.4, 1.9], [3], [2, 3]),  # thinner than a cell
        ([4.2, 2.9], [5.9, 3.0], [0, 5], [4]),  # across the wrap
        ([4.2, 2.9], [6.1, 3.6], [0, 1, 5], [4]),  # and beyond the bounds
        ([-np.inf, 1.0], [np.inf, 1.0], [0, 1, 2, 3, 4, 5], [1]),
        ([0.5, -np.inf], [0.5, np.inf], [1], [0, 1, 2, 3, 4]),
        ([-1.0, 0.0], [5.0, 3.0], [0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4]),
        ([-9.0, 0.0], [9.0, 0.4], [0, 1, 2, 3, 4, 5], [0]),  # wider than the period
        ([0.5, 3.5], [0.5, 4.0], [], []),  # outside
        ([0.5, 3.5], [0.5, 3.5], [], []),  # a point outside
    ],
)
def test_cells_in(lower, upper, rows, columns):
    expected = sorted(5 * row + column for row in rows for column in columns)
    cells = grid_of((6, 5)).cells_in(Box(np.array(lower), np.array(upper)))
    np.testing.assert_array_equal(cells, expected)


@pytest.mark.parametrize("shape", SHAPES)
def test_cells_in_holds_the_cell_of_every_point(shape):
    grid = grid_of(shape)
    for state in random_states(grid, 30):
        np.testing.assert_array_equal(grid.cells_in(Box.point(state)), [grid.index(state)])


@pytest.mark.parametrize("shape", [(7,), (6, 5), (4, 5, 3), (3, 4, 2, 3)])
def test_interpolation_is_exact_for_multilinear_functions(shape):
    n = len(shape)
    space = StateSpace(Box(LOWER[:n], UPPER[:n]), np.zeros(n, dtype=bool), tuple("abcd"[:n]))
    grid = Grid(space, shape)
    slopes = np.random.default_rng(1).normal(size=(2, n))

    def function(states):
        return np.stack([np.prod(1 + slope * states, axis=-1) for slope in slopes], axis=-1)

    states = random_states(grid, 200).reshape(20, 10, n)
    values = grid.interpolate(function(grid.centers), states)
    np.testing.assert_allclose(values, function(states), rtol=1e-10, atol=1e-10)


def test_interpolation_is_linear_across_the_periodic_seam():
    grid = grid_of((6, 5))
    values = np.random.default_rng(2).normal(size=(6, 5))
    share = np.linspace(0, 1, 11)
    # From the last centre, 4.5, to the first, -0.5, which is 5.5 as well.
    for states in (4.5 + share, -1.5 + share):
        across = grid.interpolate(
            values.ravel(), np.stack([states, np.full(11, grid.axes[1][2])], axis=-1)
        )
        expected = (1 - share) * values[5, 2] + share * values[0, 2]
        np.testing.assert_allclose(across, expected, atol=1e-12)


def test_interpolation_outside_takes_the_value_at_the_bound():
    grid = grid_of((6, 5))
    values = grid.centers[:, 1]
    outside = grid.interpolate(values, [[0.3, 9.0], [0.3, -9.0]])
    np.testing.assert_allclose(outside, [3.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_interpolation_returns_the_values_at_the_centres(shape):
    grid = grid_of(shape)
    values = np.random.default_rng(3).normal(size=(grid.size, 2, 3))
    np.testing.assert_allclose(grid.interpolate(values, grid.centers), values, atol=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_slope_agrees_with_central_differences_of_the_interpolation(shape):
    grid = grid_of(shape)
    values = np.random.default_rng(4).normal(size=grid.size)
    states = random_states(grid, 50)
    slope = grid.slope(values, states)
    for d, nudge in enumerate(1e-7 * np.eye(len(shape))):
        rise = grid.interpolate(values, states + nudge) - grid.interpolate(values, states - nudge)
        np.testing.assert_allclose(slope[:, d], rise / 2e-7, atol=1e-6)


def test_slope_is_zero_beyond_the_bounds():
    grid = grid_of((6, 5))
    slope = grid.slope(grid.centers @ [0.0, 1.0], np.array([[0.3, 1.0], [0.3, 3.1], [9.0, -0.1]]))
    np.testing.assert_allclose(slope, [[0, 1], [0, 0], [0, 0]], atol=1e-12)


@pytest.mark.parametrize(("shape", "share"), [((7,), 0.5), ((6, 5), 0.3), ((4, 5, 3), 0.9)])
def test_shifted_cells_are_those_of_a_shifted_space(shape, share):
    plain = grid_of(shape)
    offset = np.where(plain.space.periodic, share, 0.0)
    grid, move = Grid(plain.space, shape, tuple(offset)), offset * plain.widths
    bounds = Box(plain.space.bounds.lower + move, plain.space.bounds.upper + move)
    moved = Grid(StateSpace(bounds, plain.space.periodic, plain.space.names), shape)
    states = random_states(grid, 500, beyond=0.3)
    np.testing.assert_array_equal(grid.index(states), moved.index(states))
    np.testing.assert_array_equal(grid.index(grid.centers), np.arange(grid.size))
    np.testing.assert_allclose(grid.centers, moved.centers)
    np.testing.assert_allclose(grid.corners, moved.corners)
    np.testing.assert_allclose(grid.points_inside(2), moved.points_inside(2))
    values = np.random.default_rng(5).normal(size=grid.size)
    for function in ("interpolate", "slope"):
        found, expected = (getattr(each, function)(values, states) for each in (grid, moved))
        np.testing.assert_allclose(found, expected, atol=1e-9)
    for state in states[:50]:
        region = Box(state - 0.7, state + 0.7)
        np.testing.assert_array_equal(grid.cells_in(region), moved.cells_in(region))


@pytest.mark.parametrize("offset", [(0.5,), (1.0, 0.0), (-0.1, 0.0), (0.0, 0.5), (np.nan, 0.0)])
def test_grid_refuses_a_shift_that_leaves_the_space(offset):
    with pytest.raises(
        ValueError, match=r"needs 2 offsets from 0 to below 1, and 0 in a dimension"
    ):
        Grid(grid_of((6, 5)).space, (6, 5), offset)


@pytest.mark.parametrize("shape", [(3,), (3, 4, 5), (3, 0), (3, -1), ()])
def test_grid_refuses(shape):
    with pytest.raises(ValueError, match=r"over \('a', 'b'\) needs 2 counts of at least 1, not"):
        Grid(grid_of((6, 5)).space, shape)


@pytest.mark.parametrize("order", ["C", "F"])
def test_a_few_states_copy_no_table(order):
    """Gradients lie a dimension after the other, and are asked for at every step of a roll-out."""
    grid = grid_of((60, 50))
    values = np.asarray(np.random.default_rng(5).normal(size=(grid.size, 2)), order=order)
    state = grid.centers[7]
    np.testing.assert_allclose(grid.interpolate(values, state), values[7], atol=1e-12)
    tracemalloc.start()
    grid.interpolate(values, state)
    grid.slope(values[:, 0], state)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < values.nbytes / 4


def test_one_state_alone_has_the_value_that_it_has_among_others():
    grid = grid_of((6, 5))
    values, states = np.random.default_rng(4).normal(size=grid.size), random_states(grid, 20)
    for state, value in zip(states, grid.interpolate(values, states), strict=True):
        assert grid.interpolate(values, state) == value
