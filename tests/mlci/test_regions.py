import itertools

import numpy as np
import pytest

from mlci.regions import Regions
from mlci.spaces import Box, StateSpace

TURN = 2 * np.pi
CYLINDER = StateSpace(
    Box(np.array([0.0, -6.0]), np.array([TURN, 6.0])), np.array([True, False]), ("angle", "speed")
)
TORUS_AND_LINE = StateSpace(
    Box(np.array([-1.0, -2.0, 0.0]), np.array([1.0, 2.0, 3.0])),
    np.array([True, False, True]),
    ("a", "b", "c"),
)
FREE = (-np.inf, np.inf)


def regions(space: StateSpace, *sides: tuple[tuple[float, float], ...]) -> Regions:
    """One region for each tuple of sides (lower, upper)."""
    return Regions.from_boxes(space, [Box(*np.array(box, dtype=float).T) for box in sides])


def meets(region_set: Regions, points: np.ndarray) -> np.ndarray:
    """Whether points (..., n) lie strictly inside each region's copies, (..., C)."""
    space = region_set.space
    inside = np.zeros((*points.shape[:-1], len(region_set)), dtype=bool)
    for turns in itertools.product(*[range(-2, 3) if wraps else (0,) for wraps in space.periodic]):
        moved = (points + np.array(turns) * space.bounds.widths)[..., None, :]
        inside |= np.all((moved > region_set.lower) & (moved < region_set.upper), axis=-1)
    return inside


def shrunk(region_set: Regions, by: float) -> Regions:
    return Regions(region_set.space, region_set.lower + by, region_set.upper - by)


@pytest.mark.parametrize(
    "region_set",
    [
        Regions.from_grid(CYLINDER, (10, 10)),
        Regions.from_grid(CYLINDER, (None, 7)),
        regions(
            CYLINDER,
            ((5.5, 7.2), (-2.0, 1.0)),  # across the wrap
            ((-8.0, -6.0), (-2.0, 1.0)),  # given turns away
            ((0.5, 6.5), (0.0, 3.0)),  # leaves a gap of less than 0.3
            ((1.0, 1.0 + TURN), (3.0, 4.0)),  # as wide as the period
            ((1.0, 12.0), (4.0, 5.0)),  # wider than the period
            ((3.0, 4.0), FREE),
            ((2.0, 3.5), (-1.0, 9.0)),  # beyond the bounds, overlapping
        ),
        Regions.from_grid(TORUS_AND_LINE, (3, None, 4)),
        regions(
            TORUS_AND_LINE,
            ((0.7, 1.4), (-1.0, 1.0), (2.5, 3.5)),  # across both wraps
            (FREE, (-1.0, 0.5), (-0.5, 0.1)),
            (FREE, FREE, (0.3, 0.6)),
        ),
    ],
    ids=["grid", "bands", "listed", "grid-3d", "listed-3d"],
)
def test_crossings_agree_with_dense_sampling(region_set):
    space, n = region_set.space, region_set.space.dimension
    rng = np.random.default_rng(0)
    starts = rng.uniform(space.bounds.lower, space.bounds.upper, size=(80, n))
    lengths = 10 ** rng.uniform(-2, 0, size=(80, 1))  # up to half a width: half a period
    steps = lengths * rng.uniform(-0.5, 0.5, size=(80, n)) * space.bounds.widths
    steps[::5, 0] = 0.0
    steps[::7, 1] = 0.0
    share = np.linspace(0, 1, 401)[:, None]
    sampled = np.array(
        [
            meets(region_set, start + share * step).any(axis=0)
            for start, step in zip(starts, steps, strict=True)
        ]
    )
    paths = np.stack([starts, starts + steps], axis=-2)
    exact = region_set.violated_by(paths)
    # Whatever a sample meets is crossed. Sampling misses only what clips a corner: a chord that
    # enters a region by more than one sample's distance stays inside for at least one sample.
    assert np.all(exact >= sampled)
    deep = shrunk(region_set, by=float(np.abs(steps).max()) / 400).violated_by(paths)
    assert np.all(sampled >= deep)
    assert 30 < exact.sum() < exact.size - 30


def test_a_path_may_be_wrapped_or_not():
    rng = np.random.default_rng(1)
    region_set = Regions.from_grid(CYLINDER, (10, 10))
    paths = np.cumsum(rng.uniform(-0.9, 1.2, size=(4, 3, 25, 2)), axis=-2) * [1.0, 0.3]
    violated = region_set.violated_by(paths)
    assert violated.shape == (4, 3, 100)
    np.testing.assert_array_equal(region_set.violated_by(CYLINDER.wrap(paths)), violated)
    alone = [[region_set.violated_by(path) for path in row] for row in paths]
    np.testing.assert_array_equal(alone, violated)


def test_a_thin_region_between_two_samples_is_caught():
    cell = CYLINDER.bounds.widths / 20
    start = np.array([6.2, 1.0])
    for direction in ([1.0, 0.0], [0.0, 1.0], [1.0, 1.0]):
        step = 2 * cell * direction
        middle = start + step / 2  # beyond the seam, for the first and the last
        thin = regions(CYLINDER, tuple(zip(middle - cell / 20, middle + cell / 20, strict=True)))
        path = np.stack([start, start + step])
        assert not meets(thin, path).any()
        assert thin.violated_by(path).all()


def test_to_touch_an_edge_is_not_to_enter():
    square = regions(CYLINDER, ((1.0, 2.0), (-1.0, 1.0)))
    outside = [
        [[1.0, -3.0], [1.0, 3.0]],  # along a side
        [[0.5, 1.0], [2.5, 1.0]],
        [[0.5, 0.5], [1.0, 0.5]],  # ends on a side
        [[2.0, 0.5], [2.5, 0.5]],  # starts on a side
        [[0.5, 0.5], [1.5, 1.5]],  # through a corner
        [[1.0, 0.0], [1.0, 0.0]],  # rests on a side
    ]
    assert not square.violated_by(outside).any()
    inside = [
        [[1.0, 0.5], [1.1, 0.5]],  # starts on a side and enters
        [[1.0, -1.0], [1.5, 1.0]],  # from a corner
        [[1.5, 0.5], [1.5, 0.5]],  # rests inside
        [[1.5, 0.5], [1.4, 0.4]],  # stays inside
        [[1.5, 0.0], [1.5, 1e-310]],  # hardly moves
    ]
    assert square.violated_by(inside).all()


def test_a_region_as_wide_as_the_period_has_no_sides():
    ring = regions(CYLINDER, ((1.0, 1.0 + TURN), (3.0, 4.0)))
    assert ring.violated_by([[[1.0, 3.5]], [[1.0 - TURN, 3.5]]]).all()


def test_a_path_of_one_sample_is_a_point():
    square = regions(CYLINDER, ((6.0, 7.0), (-1.0, 1.0)), ((1.0, 2.0), (-1.0, 1.0)))
    points = np.array([[0.2, 0.0], [6.1, 0.9], [1.5, -0.5], [1.0, 0.0], [3.0, 0.0]])
    expected = [[True, False], [True, False], [False, True], [False, False], [False, False]]
    np.testing.assert_array_equal(square.violated_by(points[:, None, :]), expected)


def test_a_path_crosses_what_some_chord_of_it_meets():
    """And one that is not tested crosses nothing."""
    rng = np.random.default_rng(2)
    region_set = Regions.from_grid(CYLINDER, (8, 6))
    starts = rng.uniform([0, -6], [TURN, 6], size=(30, 3, 2))
    steps = rng.normal(scale=0.5, size=(30, 3, 2))
    each = region_set.violated_by(np.stack([starts, starts + steps], axis=-2))
    gathered = region_set.crossings(starts, steps)
    assert gathered.has_sorted_indices
    np.testing.assert_array_equal(gathered.toarray(), each.any(axis=1))
    tested = rng.random(30) < 0.5
    some = region_set.crossings(starts, steps, tested)
    np.testing.assert_array_equal(some.toarray(), each.any(axis=1) & tested[:, None])


def test_boxes_of_all_sizes_are_found_in_their_buckets():
    """Against every chord with every box, one dimension at a time."""
    rng = np.random.default_rng(5)
    lower = rng.uniform([-1, -7, -4], [6, 5, 3], size=(400, 3))
    upper = lower + 10 ** rng.uniform(-3, 0.7, size=(400, 3))
    for d in range(3):
        free = rng.random(400) < 0.3
        lower[free, d], upper[free, d] = -np.inf, np.inf
    space = StateSpace(Box([0.0, -6.0, -3.0], [TURN, 6.0, 3.0]), [True, False, False], tuple("abc"))
    region_set = Regions(space, lower, upper)
    starts = rng.uniform([0, -6, -3], [TURN, 6, 3], size=(60, 3))
    ends = starts + rng.normal(scale=[0.5, 2.0, 0.2], size=(60, 3))
    expected = np.zeros((60, 400), dtype=bool)
    for turns in (-2, -1, 0, 1, 2):
        shift = np.array([turns * TURN, 0.0, 0.0])
        for chord, (start, end) in enumerate(zip(starts + shift, ends + shift, strict=True)):
            enter, leave = np.zeros(400), np.ones(400)
            for d in range(3):
                sides = np.stack([lower[:, d], upper[:, d]])
                first, last = np.sort((sides - start[d]) / (end[d] - start[d]), axis=0)
                enter, leave = np.maximum(enter, first), np.minimum(leave, last)
            expected[chord] |= enter < leave
    found = region_set.violated_by(np.stack([starts, ends], axis=1))
    assert 500 < np.sum(expected) < 20000
    np.testing.assert_array_equal(found, expected)


def test_no_chords_cross_nothing():
    region_set = Regions.from_grid(CYLINDER, (2, 2))
    nothing = region_set.crossings(np.empty((3, 0, 2)), np.empty((3, 0, 2)))
    assert nothing.shape == (3, 4)
    assert nothing.nnz == 0
    nowhere = Regions.from_boxes(CYLINDER, []).violated_by(np.zeros((5, 4, 2)))
    assert nowhere.shape == (5, 0)


def test_a_grid_of_regions_covers_every_point_once():
    states = np.random.default_rng(3).uniform([-9, -6], [9, 6], size=(300, 2))
    for shape in ((10, 10), (None, 4), (3, None)):
        region_set = Regions.from_grid(CYLINDER, shape)
        assert len(region_set) == np.prod([count or 1 for count in shape])
        np.testing.assert_array_equal(region_set.violated_by(states[:, None]).sum(axis=-1), 1)
        free = [count is None for count in shape]
        np.testing.assert_array_equal(np.isinf(region_set.lower), [free] * len(region_set))
        np.testing.assert_array_equal(np.isinf(region_set.upper), [free] * len(region_set))


def test_signed_distance_is_that_of_the_nearest_region():
    region_set = regions(CYLINDER, ((1.0, 2.0), (0.0, 1.0)), ((1.5, 3.0), (-1.0, 0.5)))
    points = np.array([[0.5, 0.5], [1.8, 0.2], [6.2, -0.5], [4.0, -1.0]])
    expected = [0.5, -0.3, np.hypot(1.0 + TURN - 6.2, 0.5), 1.0]
    np.testing.assert_allclose(region_set.signed_distance(points), expected)


def test_inside_agrees_with_sampled_points():
    truth = regions(
        CYLINDER,
        ((5.0, 7.6), (-3.0, 0.0)),
        (FREE, (4.0, 6.0)),
        ((1.0, 2.0), (0.0, 1.0)),
        ((1.0, 2.0), (-7.0, -5.0)),  # reaches out of the state space
    )
    hypotheses = Regions.from_grid(CYLINDER, (20, 24)).joined(
        regions(
            CYLINDER,
            ((1.2, 1.8), (0.2, 0.8)),
            ((1.2, 2.1), (0.2, 0.8)),  # sticks out
            (FREE, (4.5, 5.5)),
            (FREE, (0.2, 0.8)),  # free where the truth is not
            ((-1.0, 1.0), (-2.5, -0.5)),  # given a turn away
            ((0.0, 3.0), FREE),
            ((1.0, 1.0 + TURN), (4.0, 5.0)),
            ((-1.0, 1.0), (4.5, 5.5)),  # across the wrap, where the truth has no sides
            (FREE, (5.0, 9.0)),  # sticks out of the state space only
            ((1.2, 1.8), (-9.0, -7.0)),  # is outside of it
        )
    )
    share = np.random.default_rng(4).uniform(0.001, 0.999, size=(400, 2))
    expected = []
    for i in range(len(hypotheses)):
        box = hypotheses.box(i)
        lower, upper = np.maximum(box.lower, [-TURN, -6.0]), np.minimum(box.upper, [2 * TURN, 6.0])
        points = lower + share * (upper - lower)
        expected.append(bool(np.all(lower < upper)) and meets(truth, points).all(axis=0).any())
    np.testing.assert_array_equal(hypotheses.inside(truth), expected)
    assert 10 < sum(expected) < 200


def test_overlaps_agrees_with_sampled_points():
    truth = regions(
        CYLINDER, ((5.0, 7.6), (-3.0, 0.0)), (FREE, (4.0, 9.0)), ((1.0, 2.0), (0.0, 1.0))
    )
    hypotheses = Regions.from_grid(CYLINDER, (20, 24)).joined(
        regions(
            CYLINDER,
            ((1.2, 1.8), (0.2, 0.8)),
            ((0.5, 2.5), (-0.5, 1.5)),  # holds one of the truth
            ((0.5, 2.5), (0.2, 0.8)),  # lies across one, without a corner in it
            ((2.0, 3.0), (0.0, 1.0)),  # shares an edge only
            ((2.0, 3.0), (1.0, 2.0)),  # shares a corner only
            ((3.0, 11.0), (-2.0, -1.0)),  # wider than the period
            ((1.5, 4.9), (-2.0, -1.0)),  # in the gap that the truth leaves
            ((1.0, 5.5), (-2.0, -1.0)),  # meets both ends of the truth
            ((-1.0, 0.5), (-2.5, -0.5)),  # given a turn away
            ((3.0, 4.0), FREE),
            (FREE, (0.5, 3.0)),  # all round
            (FREE, (2.0, 3.0)),  # all round, where the truth is not
            (FREE, (-9.0, -5.0)),  # sticks out of the state space
            (FREE, (6.0, 9.0)),  # shares with the truth what is beyond the state space
        )
    )
    share = np.random.default_rng(5).uniform(0.001, 0.999, size=(200, 2))

    def points(one: Regions, index: int) -> np.ndarray:
        box = one.box(index)
        free = np.isinf(box.lower)
        lower, upper = np.where(free, [[0.0, -6.0], [TURN, 6.0]], [box.lower, box.upper])
        drawn = lower + share * (upper - lower)
        return drawn[np.abs(drawn[:, 1]) < 6.0]

    def expected(one: Regions, other: Regions) -> list[bool]:
        drawn = np.concatenate([points(other, j) for j in range(len(other))])
        in_other = [meets(other, points(one, i)).any() for i in range(len(one))]
        return (np.array(in_other) | meets(one, drawn).any(axis=0)).tolist()

    for one, other in ((hypotheses, truth), (truth, hypotheses)):
        assert one.overlaps(other).tolist() == expected(one, other)
    listed = hypotheses.overlaps(truth)[480:].astype(int).tolist()
    assert listed == [1, 1, 1, 0, 0, 1, 0, 1, 1, 1, 1, 0, 0, 0]


@pytest.mark.parametrize("seed", range(3))
def test_overlaps_is_to_share_a_cell_of_a_lattice(seed):
    """Sides on a lattice of 12 x 24 cells: many share an edge, some are given turns away."""
    rng = np.random.default_rng(seed)
    step = CYLINDER.bounds.widths / [12, 24]
    centres = np.stack(np.meshgrid(np.arange(12), np.arange(24)), axis=-1).reshape(-1, 2) + 0.5
    centres = centres * step - [0.0, 6.0]

    def drawn() -> Regions:
        lower = rng.integers([-12, -6], [18, 28], size=(60, 2))
        upper = lower + rng.integers([1, 1], [16, 9], size=(60, 2))
        lower, upper = (corner * step - [0.0, 6.0] for corner in (lower, upper))
        free = rng.random((60, 2)) < 0.05
        return Regions(CYLINDER, np.where(free, -np.inf, lower), np.where(free, np.inf, upper))

    one, other = drawn(), drawn()
    shared = meets(one, centres).T.astype(int) @ meets(other, centres).astype(int) > 0
    assert 0.1 < shared.mean() < 0.9
    for j in range(60):
        alone = Regions(CYLINDER, other.lower[[j]], other.upper[[j]])
        np.testing.assert_array_equal(one.overlaps(alone), shared[:, j])
    np.testing.assert_array_equal(other.overlaps(one), shared.any(axis=0))


def test_no_regions_are_entered_by_nothing_and_far_from_everywhere():
    nothing = Regions.from_boxes(CYLINDER, [])
    some = regions(CYLINDER, ((1.0, 2.0), (0.0, 1.0)))
    paths = np.random.default_rng(0).uniform(-3, 3, size=(4, 9, 2))
    assert len(nothing) == 0
    assert nothing.violated_by(paths).shape == (4, 0)
    assert np.all(nothing.signed_distance(paths) == np.inf)
    assert nothing.signed_distance(paths).shape == (4, 9)
    assert some.inside(nothing).tolist() == [False]
    assert nothing.inside(some).shape == (0,)
    assert some.overlaps(nothing).tolist() == [False]
    assert nothing.overlaps(some).shape == (0,)
    for both in (nothing.joined(some), some.joined(nothing)):
        np.testing.assert_array_equal(both.violated_by(paths), some.violated_by(paths))


def test_joined_keeps_the_order():
    first = regions(CYLINDER, ((1.0, 2.0), (0.0, 1.0)))
    both = first.joined(regions(CYLINDER, ((3.0, 4.0), FREE)))
    assert len(both) == 2
    np.testing.assert_array_equal(both.box(0).upper, [2.0, 1.0])
    np.testing.assert_array_equal(both.box(1).lower, [3.0, -np.inf])


@pytest.mark.parametrize(
    ("lower", "upper", "message"),
    [
        ([[0.0]], [[1.0]], r"shape \(C, 2\), not \(1, 1\) and \(1, 1\)"),
        ([0.0, 0.0], [1.0, 1.0], r"not \(2,\) and \(2,\)"),
        ([[0.0, 0.0]], [[1.0, 1.0], [2.0, 2.0]], r"not \(1, 2\) and \(2, 2\)"),
        ([[0.0, 0.0], [3.0, 1.0]], [[1.0, 1.0], [3.0, 2.0]], r"region 1 .*\[3.0, 1.0\] to \[3.0"),
        ([[0.0, -np.inf]], [[1.0, 2.0]], r"region 0 .*both ends finite or neither"),
        ([[0.0, np.nan]], [[1.0, 2.0]], r"region 0 needs lower < upper"),
    ],
)
def test_regions_that_make_no_sense_are_refused(lower, upper, message):
    with pytest.raises(ValueError, match=message):
        Regions(CYLINDER, np.array(lower), np.array(upper))
