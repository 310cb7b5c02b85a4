"""Tubes of regions, and that nothing in a tube can explain more than the region does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from toy_models import toy_model

from mlci.grids import Grid
from mlci.inference import Inference
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.spaces import Bools, Box
from mlci.systems import DoubleIntegrator
from mlci.tabular import TabularModel, action_grid, discretize
from mlci.ties import TieClass, cells_inside, tie_class, tube_cells

CELLS, MOVES, PARTS = 9, 3, 4


def random_world(seed: int) -> tuple[TabularModel, Bools]:
    """A table whose region 0 is a cell that some others cannot but lead to, and its tube.

    Regions 1 to 4 are parts of the tube: a move crosses one if it begins or ends in its cells.
    """
    rng = np.random.default_rng(seed)
    successor = rng.integers(0, CELLS, size=(CELLS, MOVES))
    for cell in (4, 5, 6):  # these lead to 3, if by way of each other
        successor[cell] = rng.integers(3, cell, size=MOVES)
    successor[3] = rng.integers(0, CELLS, size=MOVES)
    allowed = rng.random((CELLS, MOVES)) < 0.8
    allowed[:, 0] = True
    inside = np.arange(CELLS) == 3
    crosses = np.zeros((CELLS, MOVES, 1 + PARTS), dtype=bool)
    crosses[..., 0] = inside[:, None] | inside[successor]
    model = toy_model(successor, rng.normal(size=(CELLS, MOVES)), allowed, crosses.reshape(-1, 5))
    tube = tube_cells(model.merged, 0)
    for number in range(1, 1 + PARTS):
        part = tube & (rng.random(CELLS) < 0.6)
        crosses[..., number] = part[:, None] | part[successor]
    crossings = sparse.csr_matrix(crosses.reshape(-1, 1 + PARTS))
    return replace(model, kept=replace(model.kept, crosses=crossings)), tube


@pytest.mark.parametrize("seed", range(40))
def test_nothing_in_the_tube_is_entered_more_often_than_the_region(seed: int) -> None:
    model, tube = random_world(seed)
    for start in range(CELLS):
        for steps in (1, 2, 5):
            goals = np.flatnonzero(~tube)
            distribution = TrajectoryDistribution(model, start, goals, steps)
            if not distribution.is_possible:
                continue
            region, *parts = distribution.violation_probabilities()
            assert np.all(region >= np.array(parts) - 1e-12)  # sums of doubles of order 1


def test_random_tubes_are_larger_than_the_region_and_are_entered() -> None:
    """The property above is worth something only if parts are entered, and less often."""
    larger, less, sizes = 0, 0, []
    for seed in range(40):
        model, tube = random_world(seed)
        sizes.append(np.sum(tube))
        distribution = TrajectoryDistribution(model, 0, np.flatnonzero(~tube), 5)
        if tube.all() or not distribution.is_possible:
            continue
        region, *parts = distribution.violation_probabilities()
        larger += sum(part > 0 for part in parts)
        less += sum(0 < part < region - 1e-3 for part in parts)
    assert np.mean(np.array(sizes) > 1) > 0.5
    assert larger > 20
    assert less > 10


@pytest.mark.parametrize("seed", range(20))
def test_a_tube_is_what_no_path_leaves_without_the_region(seed: int) -> None:
    """Each cell by a search of its own: a path of as many moves as there are cells has a circle."""
    model, tube = random_world(seed)
    crosses = model.kept.crosses.toarray().reshape(CELLS, MOVES, -1)[..., 0]
    allowed = model.kept.allowed(model.truth)

    def goes_on(cell: int, left: int, avoiding: bool) -> bool:
        return left == 0 or any(
            goes_on(int(model.kept.successor[cell, move]), left - 1, avoiding)
            for move in np.flatnonzero(allowed[cell] & ~(avoiding & crosses[cell]))
        )

    expected = [goes_on(s, CELLS, False) and not goes_on(s, CELLS, True) for s in range(CELLS)]
    np.testing.assert_array_equal(tube, expected)


def braking() -> TabularModel:
    """A cart that cannot brake before a wall at x > 1 if it is fast.

    Region `wall` is all with x in (1, 2); `fast` lies before it, at speeds from which no braking of
    at most 1 m/s^2 avoids it; `slow` before it, at speeds from which it can.
    """
    system = DoubleIntegrator()
    space = system.space
    slow, fast = Box([0.2, -0.6], [1.0, 0.0]), Box([0.6, 1.2], [1.0, 1.8])
    boxes = [fast, slow, Box([1.0, -3.0], [2.0, 3.0])]
    regions = Regions.from_boxes(space, boxes, ("fast", "slow", "wall"))
    return discretize(system, Grid(space, (40, 30)), action_grid(system, 5), 0.25, regions)


def with_gains(model: TabularModel, avoidance: list[float]) -> Inference:
    """What one demonstration that avoids all regions says, by probabilities."""
    one = np.array([avoidance])
    return Inference(
        model.regions, ("0",), one, np.zeros(one.shape, dtype=bool), np.ones(1, dtype=bool)
    )


@pytest.mark.parametrize(
    ("avoidance", "preferred", "same", "tube"),
    [
        ([0.2, 0.2, 0.21], 2, [], [0]),  # `fast` comes first, but lies in the tube of `wall`
        ([0.2, 0.2, 0.2], 2, [1], [0]),
        ([0.2, 0.2, 0.5], 0, [1], []),  # `wall` explains much less: `fast` is no part of its tube
        ([0.25, 0.2, 0.2], 1, [2], []),  # 0.22 nat tell `fast` from the others
        ([0.25, 0.5, 0.2], 2, [], []),  # and `wall` from `fast`, though it lies in its tube
        ([0.2, 0.2, 0.2 * np.exp(0.09)], 2, [], [0]),  # below a tenth of a nat
        ([0.2, 0.2, 0.2 * np.exp(0.11)], 0, [1], []),  # and above
        ([0.5, 0.2 * np.exp(1e-6), 0.2], 2, [], []),  # nearly the same, and no part of the tube
        ([0.5, 0.2 * np.exp(1e-10), 0.2], 1, [2], []),  # the same but for rounding
        ([0.0, 0.3, 0.0], 2, [], [0]),  # what nothing avoids ties
        ([1.0, 1.0, 1.0], 0, [], []),  # nothing is explained
    ],
)
def test_the_region_is_preferred_to_its_tube(
    avoidance: list[float], preferred: int, same: list[int], tube: list[int]
) -> None:
    model = braking()
    ties = tie_class(model, with_gains(model, avoidance))
    assert (ties.preferred, ties.same.tolist(), ties.tube.tolist()) == (preferred, same, tube)


def test_a_class_in_words_and_for_programs() -> None:
    model = braking()
    names, ties = model.regions.names, tie_class(model, with_gains(model, [0.2, 0.2, 0.2]))
    assert ties.summary(names) == (
        "these demonstrations do not tell region wall from slow with the same gain and fast in its "
        "tube, from where nothing avoids it"
    )
    assert ties.record(names) == {
        "preferred": "wall",
        "same_gain": ["slow"],
        "in_its_tube": ["fast"],
    }
    alone = tie_class(model, with_gains(model, [0.9, 0.9, 0.2]))
    assert alone.summary(names) == "nothing ties with region wall"


def test_hypotheses_are_numbered_among_the_regions_of_the_model() -> None:
    model = braking()
    inference = with_gains(model, [0.2, 0.2, 0.2])
    some = np.array([True, False, True])
    few = replace(
        inference,
        hypotheses=model.regions.select(some),
        avoidance=inference.avoidance[:, some],
        violated=inference.violated[:, some],
        decided_by_cell=inference.decided_by_cell[:, some],
    )
    ties = tie_class(model, few, some)
    assert (ties.preferred, ties.tube.tolist()) == (1, [0])


def test_of_many_members_the_first_eight_are_named() -> None:
    names = tuple("abcdefghijk")
    eight = TieClass(0, np.arange(1, 9), np.zeros(0, dtype=int)).summary(names)
    assert eight.endswith("from b, c, d, e, f, g, h, i with the same gain")
    ten = TieClass(0, np.arange(1, 11), np.zeros(0, dtype=int)).summary(names)
    assert ten.endswith("from b, c, d, e, f, g, h, i and 2 more with the same gain")


def test_the_cells_of_a_region_are_those_whose_centres_it_holds() -> None:
    model = braking()
    centers = model.grid.centers
    slow = Regions.from_boxes(model.grid.space, [Box([0.2, -0.6], [1.0, 0.0])])
    expected = np.all((centers > [0.2, -0.6]) & (centers < [1.0, 0.0]), axis=1)
    np.testing.assert_array_equal(cells_inside(model, slow, 0), np.flatnonzero(expected))
