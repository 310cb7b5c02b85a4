"""Credible sets and their areas, against all subsets and a search over the cells' numbers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mlci.credible_sets import credible_set, neighbours
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace

# A ring of six, and a line of four.
SPACE = StateSpace(Box([-1.0, 0.0], [5.0, 4.0]), [True, False], ("angle", "place"))
CELLS = Regions.from_grid(SPACE, (6, 4))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("share", [0.5, 0.9, 0.95, 1.0])
def test_no_smaller_set_holds_the_share(seed: int, share: float) -> None:
    regions = Regions.from_grid(SPACE, (6, None))
    chances = np.random.default_rng(seed).dirichlet(np.full(7, 0.4))
    result = credible_set(regions, chances[1:], float(chances[0]), share)
    members = [0] * result.has_none + [i + 1 for i in result.regions]
    assert result.probability == pytest.approx(chances[members].sum())
    assert result.probability >= share - 1e-12
    fewest = min(
        size
        for size in range(1, 8)
        if any(
            chances[list(some)].sum() >= share - 1e-12
            for some in itertools.combinations(range(7), size)
        )
    )
    assert len(members) == fewest
    assert np.all(np.diff(chances[1:][result.regions]) <= 0)
    assert sum(area.probability for area in result.areas) == pytest.approx(
        chances[1:][result.regions].sum()
    )


@pytest.mark.parametrize("seed", range(20))
def test_areas_are_what_a_search_over_cells_reaches(seed: int) -> None:
    """Cells next to each other on the ring and along the line, not at a corner."""
    mask = np.random.default_rng(seed).random((6, 4)) < 0.5
    chances = np.where(mask, 1.0, 0.0).ravel() / mask.sum()
    areas = credible_set(CELLS, chances, 0.0, 1.0).areas
    left, expected = {tuple(cell) for cell in np.argwhere(mask)}, []
    while left:
        group, front = set(), [left.pop()]
        while front:
            a, b = front.pop()
            group.add(4 * a + b)
            for next_one in (((a + 1) % 6, b), ((a - 1) % 6, b), (a, b + 1), (a, b - 1)):
                if next_one in left:
                    left.remove(next_one)
                    front.append(next_one)
        expected.append(sorted(group))
    assert sorted(area.regions.tolist() for area in areas) == sorted(expected)


def area_of(regions: Regions) -> Box:
    """The hull of regions that make one area."""
    count = len(regions)
    (area,) = credible_set(regions, np.full(count, 1 / count), 0.0, 1.0).areas
    return area.hull


@pytest.mark.parametrize(
    ("cells", "lower", "upper"),
    [
        ([0], [-1, 0], [0, 1]),
        ([1, 2, 6], [-1, 1], [1, 3]),
        ([0, 20], [4, 0], [6, 1]),  # across the seam
        ([1, 0, 20, 16], [3, 0], [6, 2]),
        ([0, 4, 8, 12, 16, 20], [-np.inf, 0], [np.inf, 1]),  # all round
    ],
)
def test_a_hull_is_the_smallest_box(
    cells: list[int], lower: list[float], upper: list[float]
) -> None:
    hull = area_of(CELLS.select(np.isin(np.arange(24), cells)))
    np.testing.assert_allclose([hull.lower, hull.upper], [lower, upper])


def test_boxes_of_any_shape() -> None:
    """Free sides, overlaps, sides beyond the bounds and a period apart, and corners that touch."""
    boxes = [
        Box([0.0, -np.inf], [1.0, np.inf]),  # a stripe
        Box([1.0, 1.0], [1.5, 1.5]),  # beside it
        Box([1.5, 1.5], [2.0, 2.0]),  # at its corner
        Box([1.7, 1.9], [3.0, 3.0]),  # overlaps the last
        Box([6.5, 0.0], [6.9, 1.0]),  # the stripe again, a turn later
        Box([3.2, 0.0], [4.0, 1.0]),  # alone
    ]
    expected = np.eye(6, dtype=bool)
    for one, other in ((0, 1), (2, 3), (0, 4)):
        expected[one, other] = expected[other, one] = True
    regions = Regions.from_boxes(SPACE, boxes)
    np.testing.assert_array_equal(neighbours(regions).toarray(), expected)
    areas = credible_set(regions, np.full(6, 1 / 6), 0.0, 1.0).areas
    assert [area.regions.tolist() for area in areas] == [[0, 1, 4], [2, 3], [5]]
    np.testing.assert_allclose(
        [areas[0].hull.lower, areas[0].hull.upper], [[0, -np.inf], [1.5, np.inf]]
    )


def test_a_set_in_words() -> None:
    for chances, none, words in (
        ([0.5, 0, 0, 0.3, 0.2, 0], 0.0, "3 regions in 2 areas"),
        ([1, 0, 0, 0, 0, 0], 0.0, "1 region in 1 area"),
        ([0.2, 0, 0, 0, 0, 0], 0.8, "no constraint and 1 region in 1 area"),
        ([0, 0, 0, 0, 0, 0], 1.0, "no constraint"),
    ):
        regions = Regions.from_grid(SPACE, (6, None))
        assert str(credible_set(regions, np.array(chances), none)) == words


def test_no_constraint_wins_ties_and_may_be_all() -> None:
    one = Regions.from_grid(SPACE, (1, 1))
    result = credible_set(one, np.array([0.5]), 0.5, 0.5)
    assert (result.has_none, len(result.regions), result.areas) == (True, 0, ())
    none = Regions.from_boxes(SPACE, [])
    assert credible_set(none, np.zeros(0), 1.0).has_none


@pytest.mark.parametrize("share", [0.0, 1.1, -1.0, float("nan")])
def test_a_share_out_of_range_is_refused(share: float) -> None:
    with pytest.raises(ValueError, match=r"share of a credible set must lie in \(0, 1\]"):
        credible_set(CELLS, np.full(24, 1 / 24), 0.0, share)


def test_probabilities_that_differ_by_rounding_are_taken_in_order() -> None:
    four = Regions.from_grid(SPACE, (1, 4))
    for last in (0.3, 0.3 + 1e-16, 0.3 - 1e-16):
        result = credible_set(four, np.array([0.3, 0.1, 0.3, last]), 0.0, 0.55)
        assert result.regions.tolist() == [0, 2]
    apart = Regions.from_grid(SPACE, (6, 1)).select(np.array([1, 0, 1, 0, 0, 0], dtype=bool))
    for last in (0.5, 0.5 + 2e-16, 0.5 - 2e-16):
        areas = credible_set(apart, np.array([0.5, last]), 0.0, 1.0).areas
        assert [area.regions.tolist() for area in areas] == [[0], [1]]


def test_a_hull_is_free_where_its_regions_are() -> None:
    """In an angle too, which has no first end to count turns from."""
    bands = Regions.from_grid(SPACE, (None, 4))
    hull = area_of(bands.select(np.array([False, True, True, False])))
    np.testing.assert_array_equal([hull.lower, hull.upper], [[-np.inf, 1], [np.inf, 3]])
