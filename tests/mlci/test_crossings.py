"""Depth and time of crossings, against densely sampled paths and by hand."""

import itertools

import numpy as np
import pytest

from mlci.crossings import Crossing, crossed, stays
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace

TURN = 2 * np.pi
CYLINDER = StateSpace(
    Box(np.array([0.0, -6.0]), np.array([TURN, 6.0])), np.array([True, False]), ("angle", "speed")
)
LISTED = Regions(
    CYLINDER,
    [[5.5, -2.0], [-8.0, -2.0], [0.5, 0.0], [3.0, -np.inf], [2.0, 4.0], [-np.inf, 1.0]],
    [[7.2, 1.0], [-6.0, 1.0], [6.5, 3.0], [4.0, np.inf], [3.5, 9.0], [np.inf, 2.0]],
)
SQUARE = Regions(CYLINDER, [[1.0, -1.0]], [[2.0, 1.0]])
SAMPLES = 400  # of a chord


def sampled_stays(region_set: Regions, path: np.ndarray, time: np.ndarray) -> list[tuple]:
    """(region, duration, depth) of each stay, from many points on each chord."""
    share = np.arange(SAMPLES) / SAMPLES
    steps = CYLINDER.difference(path[1:], path[:-1])
    points = (CYLINDER.wrap(path[:-1])[:, None] + share[:, None] * steps[:, None]).reshape(-1, 2)
    moments = (time[:-1, None] + share * np.diff(time)[:, None]).ravel()
    found = []
    for number, (lower, upper) in enumerate(zip(region_set.lower, region_set.upper, strict=True)):
        sides = np.where(np.isfinite(lower), upper - lower, 1.0)
        depth = np.full(len(points), -np.inf)
        for turns in (-2, -1, 0, 1, 2):
            moved = points + np.array([turns * TURN, 0.0])
            inner, outer = (moved - lower) / sides, (upper - moved) / sides
            inner[:, 1] = np.where(lower[1] <= -6, np.inf, inner[:, 1])
            outer[:, 1] = np.where(upper[1] >= 6, np.inf, outer[:, 1])
            depth = np.maximum(depth, np.minimum(inner, outer).min(axis=1))
        for inside, group in itertools.groupby(range(len(points)), lambda i: depth[i] > 0):  # noqa: B023
            members = list(group)
            if inside:
                lasts = moments[members[-1]] - moments[members[0]]
                found.append((number, lasts, depth[members].max()))
    return found


@pytest.mark.parametrize("region_set", [LISTED, Regions.from_grid(CYLINDER, (5, 4))])
def test_stays_agree_with_dense_sampling(region_set):
    rng = np.random.default_rng(0)
    compared = 0
    for _ in range(6):
        path = np.cumsum(rng.uniform(-1.5, 1.9, size=(9, 2)) * [1.0, 0.6], axis=0)
        path[3] = path[2] + [0.0, 0.4]
        time = np.cumsum(rng.uniform(0.2, 2.0, 9))
        exact = stays(region_set, path, time)
        rows = list(zip(exact.region, exact.end - exact.begin, exact.depth, strict=True))
        tick = np.diff(time).max() / SAMPLES
        # Sampling misses stays that are shorter than the time between two samples.
        exact_rows = [row for row in rows if row[1] > 2 * tick]
        sampled = [row for row in sampled_stays(region_set, path, time) if row[1] > tick]
        assert [row[0] for row in exact_rows] == [row[0] for row in sampled]
        for (_, lasts, depth), (_, seen, deep) in zip(exact_rows, sampled, strict=True):
            assert lasts == pytest.approx(seen, abs=3 * tick)
            assert depth == deep == np.inf or depth == pytest.approx(deep, abs=0.005)
        compared += len(sampled)
        any_stay = np.zeros(len(region_set), dtype=bool)
        any_stay[exact.region] = True
        np.testing.assert_array_equal(any_stay, region_set.violated_by(path))
    assert compared > 30


def test_a_crossing_counts_from_its_depth_and_time():
    time = np.array([0.0, 1.0, 2.0, 3.0])
    path = np.array([[0.5, 0.0], [1.2, 0.0], [1.2, 0.5], [0.5, 0.5]])  # 0.2 of the width deep
    found = stays(SQUARE, path, time)
    assert found.depth == pytest.approx([0.2])
    lasts = float((found.end - found.begin)[0])
    assert lasts == pytest.approx(1 + 2 * 0.2 / 0.7)
    for crossing, counts in [
        (Crossing(), True),
        (Crossing(depth=0.19), True),
        (Crossing(depth=0.21), False),
        (Crossing(time=lasts), True),
        (Crossing(time=lasts + 1e-6), False),
        (Crossing(0.19, lasts), True),
        (Crossing(0.21, lasts), False),
    ]:
        assert crossed(SQUARE, [path], [time], crossing)[0, 0] == counts


def test_two_short_stays_are_no_long_one():
    path = np.array([[0.5, 0.0], [1.5, 0.0], [0.5, 0.0], [1.5, 0.0], [0.5, 0.0]])
    time = np.arange(5.0)
    assert len(stays(SQUARE, path, time).region) == 2
    assert crossed(SQUARE, [path], [time], Crossing(time=0.9)).all()
    assert not crossed(SQUARE, [path], [time], Crossing(time=1.1)).any()


def test_a_stay_goes_on_across_the_seam_of_an_angle():
    ring = Regions(CYLINDER, [[5.5, -1.0]], [[7.0, 1.0]])
    path = np.array([[5.0, 0.0], [6.2, 0.0], [6.4, 0.0], [6.9, 0.0], [7.5, 0.0]])
    for shown in (path, CYLINDER.wrap(path)):
        found = stays(ring, shown, np.arange(5.0))
        assert len(found.region) == 1
        assert found.depth == pytest.approx([0.5])


def test_a_side_at_the_border_of_the_space_has_no_depth():
    edges = Regions(CYLINDER, [[1.0, 5.0], [-np.inf, -6.0]], [[2.0, 7.0], [np.inf, -5.0]])
    path = np.array([[1.5, 6.0], [1.5, -6.0]])
    assert stays(edges, path, np.arange(2.0)).depth == pytest.approx([0.5, 1.0])
    unit = np.array([0.1, 0.1])
    assert stays(edges, path, np.arange(2.0), unit).depth == pytest.approx([5.0, 10.0])


@pytest.mark.parametrize(
    ("values", "message"), [((0.5, 0.0), "depth is in"), ((-0.1, 0), "depth"), ((0, -1.0), "0 s")]
)
def test_what_no_crossing_can_be_is_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Crossing(*values)


def test_a_crossing_of_just_the_depth_that_is_asked_for_counts():
    path = np.array([[0.5, 0.0], [1.25, 0.0], [1.25, 0.5], [0.5, 0.5]])
    assert stays(SQUARE, path, np.arange(4.0)).depth.tolist() == [0.25]
    assert crossed(SQUARE, [path], [np.arange(4.0)], Crossing(depth=0.25)).all()
