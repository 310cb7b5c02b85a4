"""Boxes and paths in the plane: a circle is cut open, and nothing gets lost at the cut."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from page_answers import CIRCLE, wave

from mlci.planes import Plane, planes, simplified
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace

TURN = 2 * np.pi
PLANE = Plane(CIRCLE, 0, 1)


def length(points: np.ndarray) -> float:
    return float(np.sum(np.hypot(*np.diff(points, axis=0).T)))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_path_that_winds_is_cut_at_the_seam_and_keeps_its_length(way: float) -> None:
    angle = 0.3 + way * np.linspace(0, 3.2 * TURN, 40)
    states = np.column_stack([angle, np.linspace(-5, 5, 40)])
    pieces = PLANE.pieces(states)
    assert len(pieces) == 4 if way > 0 else 5
    assert sum(map(length, pieces)) == pytest.approx(length(states))
    for piece in pieces:
        assert piece[:, 0].min() >= -1e-9
        assert piece[:, 0].max() <= TURN + 1e-9
    for one, two in itertools.pairwise(pieces):
        np.testing.assert_allclose(one[-1, 1], two[0, 1])
        assert {round(one[-1, 0], 6), round(two[0, 0], 6)} == {0.0, round(TURN, 6)}


def test_a_path_through_a_corner_of_a_torus_and_one_along_the_seam() -> None:
    torus = StateSpace(Box([0, 0], [1, 1]), [True, True], ("a", "b"))
    plane = Plane(torus, 0, 1)
    through = plane.pieces(np.column_stack([np.linspace(0.5, 1.5, 5)] * 2))
    np.testing.assert_allclose(np.concatenate(through).max(), 1.0)
    assert sum(map(length, through)) == pytest.approx(np.sqrt(2))
    along = plane.pieces(np.column_stack([np.ones(5), np.linspace(0.1, 0.5, 5)]))
    assert sum(map(length, along)) == pytest.approx(0.4)
    back = plane.pieces(np.array([[1.0, 0.5], [0.9, 0.5], [0.8, 0.5]]))
    assert sum(map(length, back)) == pytest.approx(0.2)


def test_a_box_across_the_seam_is_seen_on_both_sides() -> None:
    across = PLANE.rectangles(Box([1.75 * np.pi, 0.0], [2.25 * np.pi, 1.0]))
    np.testing.assert_allclose(across, [(1.75 * np.pi, TURN, 0, 1), (0, 0.25 * np.pi, 0, 1)])
    shifted = PLANE.rectangles(Box([-0.5, 0.0], [0.0, 1.0]))
    np.testing.assert_allclose(shifted, [(TURN - 0.5, TURN, 0, 1)])
    everywhere = PLANE.rectangles(Box([-np.inf, 5.0], [np.inf, 9.0]))
    np.testing.assert_allclose(everywhere, [(0, TURN, 5, 6)])
    round_about = PLANE.rectangles(Box([1.0, 0.0], [8.0, 1.0]))
    np.testing.assert_allclose(round_about, [(0, TURN, 0, 1)])
    assert PLANE.rectangles(Box([0.0, 7.0], [1.0, 8.0])) == ()


def test_planes_are_pairs_of_dimensions_that_regions_bound() -> None:
    space = StateSpace(Box([0] * 4, [1] * 4), [False] * 4, ("a", "b", "c", "d"))

    def pairs(*shape: int | None) -> list[tuple[int, int | None]]:
        return [(each.x, each.y) for each in planes(Regions.from_grid(space, shape))]

    assert pairs(2, None, 2, None) == [(0, 2)]
    assert pairs(None, 2, None, None) == [(0, 1), (1, 2), (1, 3)]
    assert pairs(2, 2, 2, 2) == list(itertools.combinations(range(4), 2))
    line = StateSpace(Box([0], [1]), [False], ("a",))
    (only,) = planes(Regions.from_grid(line, (3,)))
    assert only.rectangles(Box([0.25], [0.5])) == ((0.25, 0.5, 0.0, 1.0),)
    assert only.pieces(np.array([[0.1], [0.9]]))[0].tolist() == [[0.1, 0.5], [0.9, 0.5]]


def test_a_simplified_line_stays_near_all_points_and_keeps_its_ends() -> None:
    points = wave(3).states
    few = simplified(points, 0.05)
    assert len(few) < 100
    np.testing.assert_array_equal(few[[0, -1]], points[[0, -1]])
    dense = np.concatenate([np.linspace(a, b, 50) for a, b in itertools.pairwise(few)])
    away = np.hypot(*np.moveaxis(points[:, None] - dense, 2, 0)).min(axis=1)
    assert away.max() < 0.06
    circle = np.column_stack([np.cos(np.linspace(0, TURN, 99)), np.sin(np.linspace(0, TURN, 99))])
    assert len(simplified(circle, 0.01)) > 10
    assert len(simplified(np.zeros((5, 2)), 0.1)) == 2
