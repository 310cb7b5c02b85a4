"""Shapes against dense sampling, volumes, and the laws of sets."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.crossings import Crossing, crossed, stays
from mlci.regions import Regions
from mlci.shapes.balls import Ball
from mlci.shapes.half_spaces import HalfSpace
from mlci.shapes.membership import volume_share
from mlci.shapes.predicates import InTaskSpace, Predicate
from mlci.shapes.shape import Complement, Cuboid, Intersection, Shape, Union
from mlci.spaces import Box, StateSpace

PLANE = StateSpace(Box([-2, -2], [2, 2]), [False, False], ("x", "y"))
CYLINDER = StateSpace(Box([0, -3], [2 * np.pi, 3]), [True, False], ("angle", "rate"))
SOLID = StateSpace(Box([-1, 0, -3], [1, 2, 3]), [False, True, False], ("x", "angle", "z"))
LINKS = np.array([1.0, 0.8])


def hand(states: np.ndarray) -> np.ndarray:
    """Where the hand (..., 2) of an arm of two links is, at angles (..., 2) [rad]."""
    first, second = states[..., 0], states[..., 0] + states[..., 1]
    return np.stack(
        [
            LINKS[0] * np.cos(first) + LINKS[1] * np.cos(second),
            LINKS[0] * np.sin(first) + LINKS[1] * np.sin(second),
        ],
        axis=-1,
    )


def ring(states: np.ndarray) -> np.ndarray:
    """Truth values: between two circles round the origin."""
    away = np.hypot(states[..., 0], states[..., 1])
    return (away > 0.5) & (away < 1.1)


ELLIPSE = Ball([0.3, -0.2], [0.9, 0.4])
SEAM = Ball([0.2, 0.5], [1.1, 1.5])  # goes round the seam of the cylinder
WIDE = Ball([1.0, 0.0], [4.0, 1.0])  # wider than a turn: it overlaps itself
SQUARE = Cuboid(Box([-0.5, -0.5], [1.0, 0.5]))
BAND = Cuboid(Box([5.5, -1.0], [7.0, 1.0]))
FREE = Ball([0.1, 1.8, 0.0], [0.4, 0.5, np.inf])  # a cylinder through the seam
SLOPE = HalfSpace([1.0, -2.0], 0.4)
SHAPES = {
    "ellipse": (PLANE, ELLIPSE),
    "ball round the seam": (CYLINDER, SEAM),
    "ball wider than a turn": (CYLINDER, WIDE),
    "free ball": (SOLID, FREE),
    "half-space": (PLANE, SLOPE),
    "half-space across a cylinder": (CYLINDER, HalfSpace([0.0, -1.0], 0.5)),
    "square": (PLANE, SQUARE),
    "box round the seam": (CYLINDER, BAND),
    "union": (PLANE, ELLIPSE | SLOPE | SQUARE),
    "intersection": (PLANE, SQUARE & SLOPE & ELLIPSE),
    "complement": (CYLINDER, ~(SEAM | BAND)),
    "difference": (CYLINDER, SEAM & ~BAND),
    "ring": (PLANE, Predicate(ring)),
    "levels": (PLANE, Predicate(lambda x: np.sin(3 * x[..., 0]) - x[..., 1], steepness=3.2)),
    "hand": (CYLINDER, InTaskSpace(hand, Box([0.5, 0.5], [1.2, 1.0]), steepness=2.8)),
    "hand and rate": (
        CYLINDER,
        InTaskSpace(hand, Ball([1.0, 0.5], 0.4)) & HalfSpace([0.0, 1.0], -0.5),
    ),
}
each_shape = pytest.mark.parametrize(
    ("space", "shape"), [pytest.param(*pair, id=name) for name, pair in SHAPES.items()]
)


def chords(space: StateSpace, count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random starts and steps (count, n), of up to just less than half the bounds."""
    rng, n = np.random.default_rng(seed), space.dimension
    starts = rng.uniform(space.bounds.lower, space.bounds.upper, (count, n))
    length = rng.uniform(0, 0.499, (count, 1))
    return starts, rng.uniform(-1, 1, (count, n)) * length * space.bounds.widths


@each_shape
def test_spans_are_where_the_level_is_below_0(space: StateSpace, shape: Shape):
    starts, steps = chords(space, 120)
    spans = shape.spans(space, starts, steps)
    share = np.linspace(0, 1, 401)
    states = starts[:, None] + share[:, None] * steps[:, None]
    inside = shape.level(space, space.wrap(states)) < 0
    claimed, near = np.zeros((2, *inside.shape), dtype=bool)
    for chord, enter, leave in zip(spans.chord, spans.enter, spans.leave, strict=True):
        assert 0 <= enter < leave <= 1
        claimed[chord] |= (share > enter) & (share < leave)
        near[chord] |= np.minimum(np.abs(share - enter), np.abs(share - leave)) < 1e-9
    assert 0 < np.mean(inside) < 1
    np.testing.assert_array_equal(claimed[~near], inside[~near])


@each_shape
def test_regions_cross_what_samples_enter(space: StateSpace, shape: Shape):
    regions = Regions.from_shapes(space, [shape, Box([-np.inf] * 3, [np.inf] * 3)][:1])
    starts, steps = chords(space, 200, seed=1)
    paths = np.stack([starts, starts + steps / 2, starts + steps], axis=1)
    share = np.linspace(0, 1, 401)[:, None]
    dense = space.wrap(starts[:, None] + share * steps[:, None])
    entered = np.any(shape.level(space, dense) < 0, axis=1)
    assert 0 < entered.sum() < 200
    np.testing.assert_array_equal(regions.violated_by(space.wrap(paths))[:, 0] >= entered, True)
    # What is crossed between two samples alone is a short cut of a corner.
    assert np.mean(regions.violated_by(paths)[:, 0] != entered) < 0.02


@each_shape
def test_level_is_bounded_by_distance(space: StateSpace, shape: Shape):
    if not shape.has_distance:
        return
    rng = np.random.default_rng(2)
    states = rng.uniform(space.bounds.lower, space.bounds.upper, (2000, space.dimension))
    others = states + rng.normal(0, 1, states.shape) * rng.choice([0.01, 0.3], (2000, 1))
    rise = np.abs(shape.level(space, others) - shape.level(space, states))
    assert np.all(rise <= np.linalg.norm(others - states, axis=1) + 1e-12)


@each_shape
def test_hull_holds_the_shape(space: StateSpace, shape: Shape):
    rng = np.random.default_rng(3)
    states = rng.uniform(space.bounds.lower, space.bounds.upper, (5000, space.dimension))
    inside = shape.level(space, states) < 0
    hull = shape.hull(space)
    assert np.all(space.signed_distance(states[inside], hull) <= 1e-12)


@each_shape
def test_volume_is_that_of_random_states(space: StateSpace, shape: Shape):
    rng = np.random.default_rng(4)
    states = rng.uniform(space.bounds.lower, space.bounds.upper, (40_000, space.dimension))
    share = np.mean(shape.level(space, states) < 0)
    # Four standard errors of the random states, and what 4096 even points may miss.
    assert volume_share(space, shape) == pytest.approx(share, abs=4 * np.sqrt(0.25 / 40_000))


def test_ball_has_the_volume_of_its_formula():
    expected = np.pi * 0.9 * 0.4 / 16
    assert volume_share(PLANE, ELLIPSE) == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize("seed", range(3))
def test_de_morgan(seed: int):
    starts, steps = chords(PLANE, 400, seed)
    parts = ELLIPSE, SLOPE, SQUARE
    pairs = (
        (Complement(Union(parts)), Intersection(tuple(~part for part in parts))),
        (Complement(Intersection(parts)), Union(tuple(~part for part in parts))),
    )
    for one, other in pairs:
        first, second = (shape.spans(PLANE, starts, steps) for shape in (one, other))
        np.testing.assert_array_equal(first.chord, second.chord)
        np.testing.assert_allclose(first.enter, second.enter, atol=1e-12)
        np.testing.assert_allclose(first.leave, second.leave, atol=1e-12)
        states = starts + steps
        np.testing.assert_array_equal(one.level(PLANE, states), other.level(PLANE, states))


def test_complement_of_a_complement_is_the_shape():
    starts, steps = chords(CYLINDER, 400)
    once, twice = (shape.spans(CYLINDER, starts, steps) for shape in (SEAM, ~~SEAM))
    np.testing.assert_array_equal(once.chord, twice.chord)
    np.testing.assert_array_equal(once.enter, twice.enter)
    np.testing.assert_array_equal(once.leave, twice.leave)


def test_ellipse_is_the_limit_of_many_boxes():
    center, radii = ELLIPSE.center, ELLIPSE.radii
    starts, steps = chords(PLANE, 2000, seed=5)
    paths = np.stack([starts, starts + steps], axis=1)
    crossed_ellipse = Regions.from_shapes(PLANE, [ELLIPSE]).violated_by(paths)[:, 0]
    differ = []
    for strips in (10, 100, 1000):
        sides = np.linspace(-1, 1, strips + 1)
        inner = np.sqrt(1 - np.maximum(np.abs(sides[1:]), np.abs(sides[:-1])) ** 2)
        boxes = [
            Box(center + radii * [low, -half], center + radii * [high, half])
            for low, high, half in zip(sides[:-1], sides[1:], inner, strict=True)
            if half > 0
        ]
        within = np.any(Regions.from_boxes(PLANE, boxes).violated_by(paths), axis=1)
        assert np.all(crossed_ellipse >= within)  # the boxes lie in the ellipse
        differ.append(np.mean(crossed_ellipse != within))
    assert differ[0] > differ[1] > differ[2]
    assert differ[2] < 2e-3


def test_box_as_a_shape_is_the_box_of_regions():
    starts, steps = chords(CYLINDER, 500, seed=6)
    paths = np.stack([starts, starts + steps], axis=1)
    box = Regions.from_boxes(CYLINDER, [BAND.box])
    union = Regions.from_shapes(CYLINDER, [Union((BAND, BAND))])
    np.testing.assert_array_equal(box.violated_by(paths), union.violated_by(paths))
    np.testing.assert_array_equal(box.signed_distance(starts), union.signed_distance(starts))
    assert Regions.from_shapes(CYLINDER, [BAND]).are_boxes.all()


def test_boxes_and_shapes_stand_side_by_side():
    listed = [SQUARE.box, ELLIPSE, Box([-2, -2], [-1, -1]), SLOPE]
    regions = Regions.from_shapes(PLANE, listed, ("a", "b", "c", "d"))
    starts, steps = chords(PLANE, 300, seed=7)
    paths = np.stack([starts, starts + steps], axis=1)
    together = regions.violated_by(paths)
    for i in range(4):
        alone = regions.select(np.arange(4) == i)
        np.testing.assert_array_equal(together[:, [i]], alone.violated_by(paths))
    first = np.arange(4) < 2
    twice = regions.select(first).joined(regions.select(~first))
    np.testing.assert_array_equal(twice.violated_by(paths), together)
    np.testing.assert_array_equal(
        regions.signed_distance(starts),
        np.min([regions.shape(i).level(PLANE, starts) for i in range(4)], axis=0),
    )


def test_no_chord_is_tested_that_is_not_asked_for():
    regions = Regions.from_shapes(PLANE, [ELLIPSE, SQUARE.box])
    starts, steps = chords(PLANE, 50)
    tested = np.arange(50) % 2 == 0
    some = regions.crossings(starts[:, None], steps[:, None], tested).toarray()
    every = regions.crossings(starts[:, None], steps[:, None]).toarray()
    np.testing.assert_array_equal(some, every & tested[:, None])


def test_to_touch_is_not_to_enter():
    circle = Regions.from_shapes(PLANE, [Ball([0, 0], 1.0), HalfSpace([1, 0], 1.0)])
    tangent = [[1.0, -1.0], [1.0, 1.0]]
    point = [[0.5, 0.0]]
    assert circle.violated_by(tangent).tolist() == [False, False]
    assert circle.violated_by(point).tolist() == [True, False]
    assert circle.violated_by([[1.5, 0.0], [0.0, 1.5]]).tolist() == [False, True]


@pytest.mark.filterwarnings("ignore:invalid value")
def test_a_path_that_is_lost_enters_nothing():
    lost = [[np.nan, 0.0], [np.inf, 0.0], [np.inf, np.nan]]
    for shape in (ELLIPSE, SLOPE, ELLIPSE | SQUARE, Predicate(lambda x: x[..., 0] > 0)):
        assert not Regions.from_shapes(PLANE, [shape]).violated_by(lost).any()


def test_inside_and_overlaps():
    cells = Regions.from_grid(PLANE, (8, 8))
    circle = Regions.from_shapes(PLANE, [Ball([0, 0], 1.0)])
    corners = np.stack(
        [Box(*pair).vertices() for pair in zip(cells.lower, cells.upper, strict=True)]
    )
    far = np.linalg.norm(corners, axis=-1)
    nearest = np.linalg.norm(np.maximum(np.maximum(cells.lower, -cells.upper), 0), axis=-1)
    np.testing.assert_array_equal(cells.inside(circle), np.all(far <= 1, axis=1))
    np.testing.assert_array_equal(cells.overlaps(circle), nearest < 1)
    assert circle.inside(Regions.from_boxes(PLANE, [Box([-1, -1], [1, 1])])).all()
    assert not circle.inside(Regions.from_boxes(PLANE, [Box([-1, -1], [1, 0.9])])).any()
    assert circle.overlaps(cells).all()
    assert circle.inside(circle).all()


def test_stays_in_a_ball():
    regions = Regions.from_shapes(PLANE, [SQUARE.box, Ball([0, 0], 1.0)])
    found = stays(regions, [[-2.0, 0.6], [0.0, 0.6], [2.0, 0.6]], [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(found.region, [1])
    np.testing.assert_allclose([found.begin[0], found.end[0]], [0.6, 1.4])
    # Nearest to the centre at 0.6 of the radius: 0.2 of the width from the border.
    assert found.depth[0] == pytest.approx(0.2, rel=5e-3)
    paths, times = [[[-2.0, 0.6], [2.0, 0.6]]], [[0.0, 2.0]]
    for crossing, counts in (
        (Crossing(0.19), True),
        (Crossing(0.21), False),
        (Crossing(0.0, 0.79), True),
        (Crossing(0.0, 0.81), False),
    ):
        assert crossed(regions, paths, times, crossing)[0, 1] == counts


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Ball([0, 0], [1, 1, 1]), "a radius for each of"),
        (lambda: Ball([0, 0], [1, 0]), "positive radii"),
        (lambda: Ball([0, 0], np.inf), "one of them finite"),
        (lambda: Ball([0, np.nan], 1), "finite centre"),
        (lambda: HalfSpace([0, 0], 1), "not all 0"),
        (lambda: HalfSpace([0, 1], np.inf), "finite offset"),
        (lambda: Union(()), "at least one shape"),
        (lambda: Predicate(ring, steepness=0.0), "steepness must be positive"),
    ],
)
def test_shapes_that_are_none(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    ("space", "shape", "message"),
    [
        (PLANE, Ball([0, 0, 0], 1), "region 0: a ball needs a centre of 2 dimensions"),
        (PLANE, HalfSpace([1], 0), "region 0: a half-space needs a normal of 2 dimensions"),
        (CYLINDER, HalfSpace([1, 0], 0), "region 0: angle wraps"),
        (PLANE, HalfSpace([1, 0], 3), "region 0 holds nothing of the bounds"),
        (PLANE, Ball([0, 100], [1, 1]), "region 0 holds nothing of the bounds"),
        (PLANE, Box([0, 90], [1, 91]), "region 0 holds nothing of the bounds"),
        (PLANE, "ball", "a region is a Box, or a shape such as a Ball or a Predicate, not 'ball'"),
        (PLANE, Predicate(lambda x: x[..., 7]), "region 0 fails: IndexError: index 7 is out"),
        (PLANE, Box([0], [1]) | ELLIPSE, "a box in 2 dimensions, not 1"),
        (PLANE, Box([0, 0], [0, 1]) | ELLIPSE, "lower < upper"),
        (PLANE, Predicate(lambda x: x), "a truth value or a level a state"),
        (PLANE, Predicate(lambda x: np.sqrt(x[..., 0])), "returned NaN"),
        (PLANE, Predicate(ring, steepness=1.0), "no steepness"),
        (PLANE, Predicate(lambda x: 2 * x[..., 0], steepness=1.0), "steeper than"),
        (PLANE, InTaskSpace(ring, Ball([0], 1)), r"a point \(k,\) a state"),
        (PLANE, InTaskSpace(lambda x: 1 / (0 * x), Ball([0, 0], 1)), "not finite"),
        (PLANE, InTaskSpace(hand, Ball([0], 1)), "centre of 2 dimensions"),
        (PLANE, InTaskSpace(hand, Ball([0, 0], 1), steepness=0.1), "steeper than"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value", "ignore:divide by zero")
def test_shapes_that_a_space_cannot_hold(space, shape, message):
    with pytest.raises(ValueError, match=message):
        Regions.from_shapes(space, [shape])


def test_one_shape_is_no_list_and_a_predicate_needs_a_function():
    with pytest.raises(ValueError, match="regions are a list of shapes, not one Ball"):
        Regions.from_shapes(PLANE, ELLIPSE)
    with pytest.raises(ValueError, match="a predicate needs a function of states, not 3"):
        Predicate(3)


def test_distance_is_asked_of_what_knows_none():
    regions = Regions.from_shapes(PLANE, [ELLIPSE, Predicate(ring)], ("ball", "ring"))
    with pytest.raises(ValueError, match="region ring knows what is inside, but not how far"):
        regions.signed_distance(np.zeros((3, 2)))


def test_as_many_shapes_as_regions():
    with pytest.raises(ValueError, match="2 regions need as many shapes"):
        Regions(PLANE, np.zeros((2, 2)), np.ones((2, 2)), (), (None,))
