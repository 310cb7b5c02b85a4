"""Areas of one or two shapes, against recursions, every pair, and every area of a small raster."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mlci.areas.belief import AreaBelief, infer_area, sets_of_shapes
from mlci.areas.evidence import ShapeEvidence, points_met, sample_paths
from mlci.areas.overlap import best_area, expected_overlap
from mlci.areas.prior_shapes import apart, draw_shapes
from mlci.demonstrations import Demonstration, Task
from mlci.evidence import Rates
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.shapes.balls import Ball
from mlci.spaces import Box, StateSpace
from mlci.systems import Pendulum
from mlci.tabular import action_grid, discretize
from mlci.zoo.planar_point import PlanarPoint

POINT = PlanarPoint(position_limit=1.5, speed_limit=1.0)
GRID = Grid(POINT.space, (6, 6))  # cells of 0.5 m, and moves of none or one along each axis
SHAPES = Regions.from_shapes(
    POINT.space,
    [Box([-0.4, -1.5], [-0.1, 0.6]), Box([-0.9, 0.1], [0.4, 0.4]), Box([0.6, -1.4], [0.9, 0.4])],
)
MODEL = discretize(POINT, GRID, action_grid(POINT, 3), 0.5, SHAPES)
START, GOAL = np.array([-1.25, -0.25]), np.array([1.25, -0.25])
TASK = Task(START, Box.point(GOAL), 4.0)
DETOUR = np.array([START, [-1.25, 1.25], [1.25, 1.25], GOAL])
RASTER = Grid(POINT.space, (60, 60))


def around(*, task: Task = TASK) -> Demonstration:
    """A demonstration that keeps out of all shapes."""
    return Demonstration(task, DETOUR, np.zeros((3, 2)), np.array([0.0, 1.0, 3.0, 4.0]), "round")


@pytest.mark.parametrize("exact_ends", [True, False])
def test_pairs_are_avoided_as_often_as_recursions_say(exact_ends: bool) -> None:
    """Moves are from centre to centre, so that straight paths between these are the model's."""
    samples = 4000
    evidence = ShapeEvidence.of(
        MODEL,
        [around()],
        SHAPES,
        RASTER,
        Rates(),
        samples=samples,
        rng=np.random.default_rng(0),
        exact_ends=exact_ends,
    )
    gain = evidence.pair_gains(np.arange(3))
    distribution = TrajectoryDistribution.of_task(MODEL, TASK, exact_ends=exact_ends)
    for i in range(3):
        exact = np.exp(distribution.log_avoidance_beside(np.arange(3) == i))
        error = np.sqrt(exact * (1 - exact) / samples)
        assert np.all(np.abs(np.exp(-gain[i]) - exact) < 5 * error + 1 / samples)
    assert np.ptp(gain) > 0.5  # shapes differ
    assert evidence.feasible.tolist() == [0, 1, 2]


def test_paths_have_the_ends_of_their_task() -> None:
    """A goal that is free in y ends where cells do."""
    task = Task(START, Box([1.25, -np.inf], [1.25, np.inf]), 4.0)
    distribution = TrajectoryDistribution.of_task(MODEL, task, exact_ends=True)
    paths = sample_paths(distribution, 50, np.random.default_rng(0))
    assert paths.shape == (50, 9, 2)
    np.testing.assert_array_equal(paths[:, 0], np.tile(START, (50, 1)))
    assert np.all(paths[:, -1, 0] == 1.25)
    assert len(np.unique(paths[:, -1, 1])) > 1
    assert np.all(GRID.index(paths[:, 1:-1]) >= 0)


@pytest.mark.parametrize(("steps", "goal"), [(3, [0.1, 0.35]), (1, [-0.2, 0.1])])
def test_paths_are_in_each_cell_as_often_as_the_forward_pass_says(
    steps: int, goal: list[float]
) -> None:
    """From and to states off the middle of their cells."""
    task = Task(np.array([-0.6, -0.15]), Box.point(goal), 0.5 * steps)
    distribution = TrajectoryDistribution.of_task(MODEL, task, exact_ends=True)
    paths = sample_paths(distribution, 2000, np.random.default_rng(0))
    assert np.all(paths[:, -1] == goal)
    for t, chance in enumerate(distribution.occupancies()):
        share = np.bincount(GRID.index(paths[:, t]), minlength=GRID.size) / 2000
        np.testing.assert_array_less(abs(share - chance), 4 * np.sqrt(chance / 2000) + 1e-9)


def test_a_path_meets_the_cell_in_which_it_ends() -> None:
    raster = Grid(POINT.space, (3, 1))  # borders at -0.5 and 0.5
    met = points_met(raster, np.array([[[-0.4, 0.0], [0.51, 0.0]]])).toarray()[0] > 0
    assert met.tolist() == [False, True, True]


def test_a_path_meets_every_cell_on_its_way_across_the_seam() -> None:
    space = Pendulum().space
    raster = Grid(space, (12, 4))
    met = points_met(raster, np.array([[[6.0, 0.1], [0.9, 0.1]]])).toarray()[0] > 0
    angle = raster.centers[:, 0]
    expected = (np.abs(raster.centers[:, 1] - 0.1) < raster.widths[1] / 2) & (
        (angle < 1.04) | (angle > 5.75)
    )
    np.testing.assert_array_equal(met, expected)


def test_who_cannot_do_a_task_says_nothing_by_what_is_avoided() -> None:
    task = Task(START, Box.point(GOAL), 1.0)  # five cells in two moves
    demonstration = Demonstration(
        task, DETOUR, np.zeros((3, 2)), np.array([0.0, 0.25, 0.75, 1.0]), "fast"
    )
    evidence = ShapeEvidence.of(
        MODEL, [demonstration], SHAPES, RASTER, Rates(), samples=5, rng=np.random.default_rng(0)
    )
    np.testing.assert_array_equal(evidence.pair_gains(np.arange(3)), 0.0)


def by_hand(rates: Rates, seed: int = 3) -> ShapeEvidence:
    """Five shapes on 12 points, two demonstrations; the last shape is entered by the first."""
    rng = np.random.default_rng(seed)
    avoided = tuple(rng.random((30, 5)) < 0.4 for _ in range(2))
    violated = np.zeros((2, 5), dtype=bool)
    violated[0, 4] = True
    inside = rng.random((12, 5)) < 0.4
    raster = Grid(StateSpace(Box([0.0], [12.0]), [False], ("place",)), (12,))
    return ShapeEvidence(avoided, violated, inside, raster, rates)


@pytest.mark.parametrize("rates", [Rates(0.05), Rates(0.05, 0.1)])
def test_the_posterior_is_that_of_all_sets_one_by_one(rates: Rates) -> None:
    evidence, sizes = by_hand(rates), (0.2, 0.3, 0.5)
    weights: dict[tuple[int, ...], float] = {(): sizes[0]}
    for size in (1, 2):
        sets = list(itertools.combinations(range(5), size))
        for members in sets:
            weight = sizes[size] / len(sets)
            for avoided, violated in zip(evidence.avoided, evidence.violated, strict=True):
                assert avoided is not None
                clear = sum(all(row[i] for i in members) for row in avoided)
                likely = (1 - rates.model_error) * (clear + 1) / 31 + rates.model_error
                kept = not any(violated[i] for i in members)
                breaking = rates.rule_breaking
                weight *= (1 - breaking) / likely + breaking if kept else breaking
            weights[members] = weight
    total = sum(weights.values())
    draws = 20_000
    belief = infer_area(evidence, np.random.default_rng(0), sizes, draws)
    of_size = [sum(w for s, w in weights.items() if len(s) == k) / total for k in range(3)]
    np.testing.assert_allclose(belief.sizes, of_size, atol=1e-12)
    best = max((s for s in weights if s), key=weights.__getitem__)
    assert belief.shapes == best
    assert belief.probability == pytest.approx(weights[best] / total)
    chance = np.zeros(12)
    for members, weight in weights.items():
        chance += weight / total * np.any(evidence.inside[:, list(members)], axis=1)
    np.testing.assert_allclose(belief.chance, chance, atol=2.5 / np.sqrt(draws))


def test_shapes_that_meet_are_not_forbidden_together() -> None:
    """Four shapes are left, of which the pairs that share a point are out, and so rarer in all."""
    evidence, sizes = by_hand(Rates(0.05)), (0.2, 0.3, 0.5)
    evidence.inside[:] = False
    for shape, points in enumerate([(0, 1, 2), (2, 3), (4, 5), (5, 6, 0), (8,)]):
        evidence.inside[list(points), shape] = True
    together = apart(evidence.inside)
    allowed = [(0, 2), (0, 4), (1, 2), (1, 3), (1, 4), (2, 4), (3, 4)]
    assert [pair for pair in itertools.combinations(range(5), 2) if together[pair]] == allowed
    gain = evidence.pair_gains(np.arange(5))
    weights = {(i, i): 0.3 / 5 * np.exp(gain[i, i]) for i in range(5)}
    weights |= {pair: 0.5 / 7 * np.exp(gain[pair]) for pair in allowed}
    total = sum(weights.values())
    sets = sets_of_shapes(evidence, sizes, together)
    assert sets.some == pytest.approx(total / (total + 0.2))
    for members, probability in zip(sets.members.tolist(), sets.probability, strict=True):
        assert probability == pytest.approx(weights.get(tuple(members), 0.0) / total)
    with pytest.raises(ValueError, match=r"pairs of 5 shapes do not fit a mask of shape \(2, 2\)"):
        infer_area(evidence, np.random.default_rng(0), sizes, together=together[:2, :2])


def test_pairs_that_may_all_be_forbidden_together_are_as_without_a_mask() -> None:
    evidence, every = by_hand(Rates(0.05)), np.ones((5, 5), dtype=bool)
    with_mask, without = sets_of_shapes(evidence, together=every), sets_of_shapes(evidence)
    np.testing.assert_array_equal(with_mask.members, without.members)
    np.testing.assert_allclose(with_mask.probability, without.probability)
    assert with_mask.some == pytest.approx(without.some)


def test_no_area_where_every_shape_is_excluded() -> None:
    evidence = by_hand(Rates())
    evidence.violated[:] = True
    belief = infer_area(evidence, np.random.default_rng(0))
    assert belief.sizes.tolist() == [1, 0, 0]
    assert not belief.area.any()
    assert belief.parts == ()
    assert np.isnan(belief.overlap)


def test_a_shape_that_holds_no_point_of_the_raster_is_not_told_of() -> None:
    evidence = by_hand(Rates())
    evidence.inside[:, 2] = False
    assert evidence.feasible.tolist() == [0, 1, 3]  # the last one is entered


def test_some_demonstrations_are_those_by_number() -> None:
    evidence = by_hand(Rates(0.05))
    both = evidence.pair_gains(np.arange(4))
    each = [evidence.of_some([j]).pair_gains(np.arange(4)) for j in range(2)]
    np.testing.assert_allclose(each[0] + each[1], both)
    assert evidence.of_some([1]).feasible.tolist() == [0, 1, 2, 3, 4]


def test_parts_of_an_area_hang_together() -> None:
    """Two shapes far apart that are certain: two parts with their hulls."""
    balls = Regions.from_shapes(POINT.space, [Ball([-0.8, 0], 0.4), Ball([0.8, 0], 0.3)])
    raster = Grid(POINT.space, (30, 30))
    inside = np.stack([balls.shape(i).level(POINT.space, raster.centers) < 0 for i in (0, 1)], 1)
    evidence = ShapeEvidence((), np.zeros((0, 2), dtype=bool), inside, raster, Rates())
    belief = infer_area(evidence, np.random.default_rng(0), (0, 0, 1))
    assert belief.overlap == pytest.approx(1)
    large, small = belief.parts
    np.testing.assert_allclose(large.hull.lower, [-1.2, -0.4], atol=0.1)
    np.testing.assert_allclose(small.hull.upper, [1.1, 0.3], atol=0.1)
    assert large.probability == pytest.approx(1)


def test_a_part_is_as_probable_as_its_most_probable_point() -> None:
    raster = Grid(StateSpace(Box([0.0], [6.0]), [False], ("place",)), (6,))
    chance = np.array([0.4, 0.8, 0.6, 0.1, 0.5, 0.3])
    belief = AreaBelief(raster, np.array([0, 1.0, 0]), chance, chance > 0.3, 0.5, (0,), 0.4, 900)
    assert [part.probability for part in belief.parts] == [0.8, 0.5]


@pytest.mark.parametrize("seed", range(8))
def test_the_best_area_of_a_small_raster(seed: int) -> None:
    """Against all 256 areas; the climb may end beside the best, by no more than a hundredth."""
    rng = np.random.default_rng(seed)
    draws = rng.random((6, 8)) < 0.5
    probability = rng.dirichlet(np.ones(6))

    def overlap(area: np.ndarray) -> float:
        each = [
            np.sum(area & draw) / np.sum(area | draw) if np.any(area | draw) else 1.0
            for draw in draws
        ]
        return float(probability @ each)

    areas = np.array(list(itertools.product([False, True], repeat=8)))
    values = np.array([overlap(area) for area in areas])
    area, value = best_area(draws, probability)
    assert value == pytest.approx(overlap(area))
    assert values.max() - 0.01 < value <= values.max() + 1e-9
    assert expected_overlap(areas[77], draws, probability) == pytest.approx(values[77])


def test_the_best_area_may_be_no_level_of_the_chances() -> None:
    """It is climbed to: what is above some chance overlaps by 0.498 at most."""
    rows = ["00111110", "01010010", "01111111", "00001110", "10000001"]
    draws = np.array([[point == "1" for point in row] for row in rows])
    probability = np.array([0.29, 0.06, 0.08, 0.25, 0.32])
    areas = np.array(list(itertools.product([False, True], repeat=8)))
    shared = (areas[:, None] & draws).sum(axis=2) / (areas[:, None] | draws).sum(axis=2)
    value = best_area(draws, probability)[1]
    assert value == pytest.approx(np.max(shared @ probability))
    assert value > 0.51


def test_nothing_overlaps_with_nothing_in_full() -> None:
    nothing = np.zeros(3, dtype=bool)
    draws = np.array([[False] * 3, [True, False, False]])
    assert expected_overlap(nothing, draws, np.array([0.3, 0.7])) == 0.3


def test_drawn_shapes_have_the_widths_that_are_asked_for() -> None:
    space, rng = POINT.space, np.random.default_rng(0)
    shapes = draw_shapes(space, 200, 0.1, 0.2, rng, free=[False, True])
    radii = np.array([shapes.shape(i).radii for i in range(200)])
    assert 0.3 <= radii[:, 0].min() < 0.32 < 0.58 < radii[:, 0].max() <= 0.6
    assert np.all(np.isinf(radii[:, 1]))
    centers = np.array([shapes.shape(i).center for i in range(200)])
    assert np.all(centers.min(axis=0) < -1.4)  # all over the space, which is 1.5 m to each side
    assert np.all(centers.max(axis=0) > 1.4)
    assert draw_shapes(space, 5, 0.1, 0.2, rng, boxes=True).are_boxes.all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, 0.1, 0.2), "at least one shape is drawn, not 0"),
        ((3, 0.0, 0.2), "0 < smallest <= largest"),
        ((3, 0.3, 0.2), "not 0.3 and 0.2"),
        ((3, 0.3, 0.6), "<= 0.5 of a range"),
    ],
)
def test_shapes_that_cannot_be_drawn(arguments: tuple[int, float, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        draw_shapes(POINT.space, *arguments, np.random.default_rng(0))


def test_refusals() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="one of them bounded"):
        draw_shapes(POINT.space, 3, 0.1, 0.2, rng, free=[True, True])
    with pytest.raises(ValueError, match="at least one trajectory"):
        ShapeEvidence.of(MODEL, [], SHAPES, RASTER, Rates(), samples=0, rng=rng)
    with pytest.raises(ValueError, match="add up to 1"):
        infer_area(by_hand(Rates()), rng, (0.5, 0.5, 0.5))
    with pytest.raises(ValueError, match="at least one draw, not 0"):
        infer_area(by_hand(Rates()), rng, draws=0)
