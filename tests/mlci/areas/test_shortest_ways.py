"""The oracle from outside by which the study `areas` is judged."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmark.shortest_ways import length, shortest


def test_shortest_way_round_a_disc_is_two_tangents_and_an_arc() -> None:
    """Of a polygon as long as the circle, so that only its corners differ from the arc."""
    start, goal, radius = np.array([-2.0, 0.0]), np.array([2.0, 0.0]), 0.8
    disc = np.array([[0.0, 0.0, radius, radius]])
    tangent = np.sqrt(4 - radius**2)
    arc = radius * (np.pi - 2 * np.arccos(radius / 2))
    assert length(shortest(start, goal, disc, 64)) == pytest.approx(2 * tangent + arc, abs=5e-5)
    apart = np.array([[0.0, 1.5, radius, radius]])
    assert length(shortest(start, goal, apart, 64)) == pytest.approx(4)


def test_ways_between_walls_and_the_edge_of_the_plane() -> None:
    """What closes the plane's whole width leaves none."""
    start, goal = np.array([-2.5, 0.0]), np.array([2.5, 0.0])
    high = np.array([[0.0, 0.0, 0.5, 3.5]])
    assert not len(shortest(start, goal, high, 16))
    assert length(shortest(start, goal, high, 16)) == np.inf
    lower = np.array([[0.0, -1.0, 0.5, 3.5]])
    way = shortest(start, goal, lower, 64)
    assert np.max(way[:, 1]) == pytest.approx(2.5, abs=0.02)
