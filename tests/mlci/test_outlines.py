"""Outlines of shapes: their area, their holes, their shadows, and where they go round."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.outlines import outline
from mlci.planes import Plane
from mlci.shapes.balls import Ball
from mlci.shapes.half_spaces import HalfSpace
from mlci.shapes.shape import Shape
from mlci.spaces import Box, StateSpace

PLANE = StateSpace(Box([-2, -2], [2, 2]), [False, False], ("x", "y"))
CYLINDER = StateSpace(Box([0, -3], [2 * np.pi, 3]), [True, False], ("angle", "rate"))
SOLID = StateSpace(Box([-2] * 3, [2] * 3), [False] * 3, ("x", "y", "z"))


def area(rings: list[np.ndarray]) -> float:
    """The area within rings, by the shoelace formula: holes, which run back, count against it."""
    parts = [np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2 for x, y in (r.T for r in rings)]
    return float(np.sum(parts))


@pytest.mark.parametrize(
    ("plane", "shape", "expected", "rings"),
    [
        (Plane(PLANE, 0, 1), Ball([0.3, 0.2], [0.5, 1.5]), np.pi * 0.75, 1),
        (Plane(PLANE, 0, 1), Ball([0, 0], 1) & ~Ball([0, 0], 0.5), np.pi * 0.75, 2),
        (Plane(CYLINDER, 0, 1), Ball([0, 0], [0.5, 1.0]), np.pi * 0.5, 2),
        (Plane(PLANE, 0, 1), HalfSpace([1, 1], 0), 8.0, 1),
        (Plane(SOLID, 0, 2), Ball([0, 0, 0], [1, 1, np.inf]), 8.0, 1),
        (Plane(PLANE, 0, 1), Box([-1, -1], [0, 0]) | Ball([1, 1], 0.5), 1 + np.pi / 4, 2),
    ],
)
def test_outline_has_the_area_of_the_shape(
    plane: Plane, shape: Shape, expected: float, rings: int
) -> None:
    drawn = outline(plane, shape)
    assert len(drawn) == rings
    assert all(np.array_equal(ring[0], ring[-1]) for ring in drawn)
    # Straight lines between lattice points cut a thousandth off a round border, and a corner by
    # half a cell.
    assert area(drawn) == pytest.approx(expected, rel=4e-3)


def test_shadow_of_a_solid_ball_is_its_disc() -> None:
    drawn = outline(Plane(SOLID, 0, 1), Ball([0, 0, 0.3], 1.0))
    # The nearest of 64 values to the middle is at most 1/64 of the height away.
    assert area(drawn) == pytest.approx(np.pi, rel=0.01)


def test_state_of_one_dimension_is_a_band() -> None:
    line = StateSpace(Box([0.0], [4.0]), [False], ("depth",))
    drawn = outline(Plane(line, 0, None), Ball([1.0], [0.5]))
    assert area(drawn) == pytest.approx(1.0, rel=1e-3)
