import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace

TURN = 2 * np.pi
CYLINDER = StateSpace(
    Box(np.array([-1.0, -3.0]), np.array([-1.0 + TURN, 3.0])),
    np.array([True, False]),
    ("angle", "speed"),
)
angles = st.floats(-1e6, 1e6, allow_subnormal=False)
repeatable = settings(derandomize=True, deadline=None)


def copies(states: np.ndarray) -> np.ndarray:
    """States of the cylinder moved by -3..3 periods, (7, ..., 2)."""
    return np.stack([states + np.array([turns * TURN, 0.0]) for turns in range(-3, 4)])


def border(box: Box, count: int) -> np.ndarray:
    """Points on the border of a bounded box, `count` along each dimension."""
    faces = []
    for d in range(box.dimension):
        ticks = [np.linspace(*side, count) for side in zip(box.lower, box.upper, strict=True)]
        ticks[d] = np.array([box.lower[d], box.upper[d]])
        faces.append(np.stack(np.meshgrid(*ticks), axis=-1).reshape(-1, box.dimension))
    return np.concatenate(faces)


@repeatable
@given(angles)
def test_wrap_is_congruent_and_half_open(angle):
    wrapped = CYLINDER.wrap([angle, 7.0])
    assert -1.0 <= wrapped[0] < -1.0 + TURN
    assert wrapped[1] == 7.0
    off_by = (angle - wrapped[0]) / TURN
    assert off_by == pytest.approx(round(off_by), abs=1e-9)


@pytest.mark.parametrize(
    "angle",
    [
        np.nextafter(-1.0, -np.inf),  # a hair below lower: adding the period rounds to upper
        -1.0 + TURN,
        -1.0 + 3 * TURN,
        np.nextafter(-1.0 + 3 * TURN, 0.0),
    ],
)
def test_wrap_stays_in_bounds_at_the_seam(angle):
    wrapped = CYLINDER.wrap([angle, 0.0])[0]
    assert -1.0 <= wrapped < -1.0 + TURN
    assert abs(CYLINDER.difference([wrapped, 0.0], [-1.0, 0.0])[0]) < 1e-14


@pytest.mark.parametrize("turns", range(1, 400, 7))
def test_wrap_copes_with_a_quotient_that_rounds_up(turns):
    circle = StateSpace(Box(np.array([0.0]), np.array([TURN])), np.array([True]), ("angle",))
    wrapped = circle.wrap([np.nextafter(turns * TURN, 0.0)])[0]
    assert 0.0 <= wrapped < TURN


@repeatable
@given(angles, angles)
def test_difference_is_the_shortest_of_all_windings(to, origin):
    step = CYLINDER.difference([to, 2.0], [origin, -1.5])
    turns = np.round((to - origin) / TURN) + np.arange(-2, 3)
    assert abs(step[0]) == pytest.approx(np.min(np.abs(to - origin - turns * TURN)), abs=1e-8)
    assert step[1] == 3.5


def test_half_a_period_counts_as_forward_both_ways():
    circle = StateSpace(Box(np.array([0.0]), np.array([8.0])), np.array([True]), ("angle",))
    assert circle.difference([4.0], [0.0]) == 4.0
    assert circle.difference([0.0], [4.0]) == 4.0
    assert circle.difference([3.0], [8.0]) == 3.0
    assert circle.difference([5.0], [0.0]) == -3.0


def test_unwrap_restores_a_path_from_its_wrapped_samples():
    time = np.linspace(0, 1, 60)
    path = np.stack([2 * np.sin(7 * time) + 15 * time, 9 * time], axis=-1)
    batch = np.stack([path, -path]) + np.array([0.5, 0.0])
    np.testing.assert_allclose(CYLINDER.unwrap(CYLINDER.wrap(batch)), batch, atol=1e-12)


def test_a_periodic_dimension_has_no_bounds():
    states = [[100.0, 3.0], [0.0, 3.1], [0.0, -3.0], [np.nan, 0.0], [0.0, np.nan]]
    np.testing.assert_array_equal(
        CYLINDER.contains(states)[[0, 1, 2, 4]], [True, False, True, False]
    )


@pytest.mark.parametrize(
    "box",
    [
        Box(np.array([0.2, -1.0]), np.array([1.1, 0.5])),
        Box(np.array([-1.4, -1.0]), np.array([0.2, 4.0])),  # across the seam, beyond the bounds
        Box(np.array([4.9, -3.0]), np.array([10.9, -2.0])),  # leaves a gap of less than 0.3
    ],
)
def test_signed_distance_agrees_with_the_nearest_border_point(box):
    states = np.random.default_rng(0).uniform([-9, -4], [9, 4], size=(200, 2))
    edge = copies(border(box, 2001)).reshape(-1, 2)
    nearest = np.array([np.min(np.hypot(*(edge - state).T)) for state in states])
    inside = box.contains(copies(states)).any(axis=0)
    assert 3 < inside.sum() < 197
    expected = np.where(inside, -nearest, nearest)
    np.testing.assert_allclose(CYLINDER.signed_distance(states, box), expected, atol=2e-3)


@pytest.mark.parametrize("side", [(-np.inf, np.inf), (0.3, 0.3 + TURN), (-5.0, 5.0)])
def test_signed_distance_ignores_a_dimension_that_the_box_covers(side):
    box = Box(np.array([side[0], -0.5]), np.array([side[1], 1.0]))
    states = np.random.default_rng(1).uniform(-3, 3, size=(50, 2))
    expected = np.abs(states[:, 1] - 0.25) - 0.75
    np.testing.assert_allclose(CYLINDER.signed_distance(states, box), expected, atol=1e-15)


def test_signed_distance_to_the_whole_space_is_minus_infinity():
    box = Box(np.array([0.0, -np.inf]), np.array([TURN, np.inf]))
    assert CYLINDER.signed_distance([0.3, 0.2], box) == -np.inf


def test_excess_leads_to_the_nearest_point_of_the_region():
    box = Box(np.array([4.9, -1.0]), np.array([6.0, 0.5]))
    states = np.random.default_rng(2).uniform([-9, -4], [9, 4], size=(200, 2))
    excess = CYLINDER.excess(states, box)
    outside = CYLINDER.signed_distance(states, box)
    np.testing.assert_allclose(np.hypot(*excess.T), np.maximum(outside, 0.0), atol=1e-12)
    on_region = CYLINDER.signed_distance(states - excess, box)
    assert np.all(on_region < 1e-12)


def test_excess_of_a_point_is_the_difference_and_a_free_dimension_has_none():
    states = np.random.default_rng(3).uniform(-9, 9, size=(50, 2))
    goal = np.array([5.0, 1.0])
    np.testing.assert_allclose(
        CYLINDER.excess(states, Box.point(goal)), CYLINDER.difference(states, goal), atol=1e-15
    )
    free = CYLINDER.excess(states, Box(np.array([-np.inf, 1.0]), np.array([np.inf, 1.0])))
    np.testing.assert_array_equal(free[:, 0], 0.0)
    np.testing.assert_allclose(free[:, 1], states[:, 1] - 1.0)


def test_box_holds_its_corners_and_lists_them():
    box = Box(np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0]))
    corners = box.vertices()
    assert {tuple(corner) for corner in corners} == set(itertools.product((0, 1), (1, 3), (2, 5)))
    assert len(corners) == 8
    assert box.contains(corners).all()
    assert not box.contains(corners + 1e-9 * np.sign(corners - [0.5, 2, 3.5])).any()


@pytest.mark.parametrize(
    ("lower", "upper", "message"),
    [
        ([0, 1], [2], r"two corners of one length, not \(2,\) and \(1,\)"),
        ([[0]], [[1]], r"two corners of one length, not \(1, 1\)"),
        ([0, 3], [1, 2], r"lower <= upper, not \[0\. 3\.\] and \[1\. 2\.\]"),
        ([np.nan], [1], "lower <= upper, not"),
    ],
)
def test_box_refuses(lower, upper, message):
    with pytest.raises(ValueError, match=message):
        Box(np.array(lower), np.array(upper))


@pytest.mark.parametrize(
    ("upper", "periodic", "names", "units", "message"),
    [
        ([1, 1], [True], ("a", "b"), (), "not 1, 2 and 2"),
        ([1, 1], [True, False], ("a",), (), "not 2, 1 and 2"),
        ([1, 1], [True, False], ("a", "b"), ("m",), "not 2, 2 and 1"),
        ([1, 0], [True, False], ("a", "b"), (), "finite and not empty"),
        ([1, np.inf], [True, False], ("a", "b"), (), "finite and not empty"),
    ],
)
def test_state_space_refuses(upper, periodic, names, units, message):
    with pytest.raises(ValueError, match=message):
        StateSpace(Box(np.zeros(2), np.array(upper)), np.array(periodic), names, units)


def test_a_region_bounded_at_one_end_only_is_refused():
    box = Box(np.array([0.0, 0.0]), np.array([1.0, np.inf]))
    for measure in (CYLINDER.excess, CYLINDER.signed_distance):
        with pytest.raises(ValueError, match="bounded at both ends or at neither"):
            measure([0.0, 0.0], box)


def test_states_of_another_space_are_refused_wherever_they_come_in() -> None:
    """Broadcasting would make sense of them, and answer for other states."""
    space = StateSpace(Box([0, 0], [1, 1]), [True, False], ("angle", "rate"))
    boxes = Regions.from_boxes(space, [Box([0.2, 0.2], [0.4, 0.4])])
    message = r"angle, rate have a last axis of 2, not an array of shape \(5, 3\)"
    for ask in (space.wrap, space.unwrap, space.contains, boxes.violated_by, boxes.signed_distance):
        with pytest.raises(ValueError, match=message):
            ask(np.zeros((5, 3)))
    with pytest.raises(ValueError, match=r"not an array of shape \(1,\)"):
        Grid(space, (3, 3)).index([0.5])
