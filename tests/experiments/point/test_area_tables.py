"""Overlap of sets of hypotheses with a truth, on a world whose areas can be told by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_point import TINY, composed

from experiments.config.read import read_config
from experiments.point.area_ceilings import ideal_world
from experiments.point.area_shapes import sizes
from experiments.point.area_tables import area_tables
from experiments.point.inference import infer_point
from experiments.point.run import run_point
from experiments.point.shape_ways import ShapeWays, overlap_scores
from experiments.point.streams import Purpose, stream
from experiments.tracking.store import Store
from mlci.areas.belief import infer_area
from mlci.areas.evidence import ShapeEvidence
from mlci.evidence import Rates
from mlci.grids import Grid
from mlci.metrics import random_subsets
from mlci.spaces import Box, StateSpace


def test_tables_of_areas(tmp_path: Path) -> None:
    """The wall from 0.6 to 1.2 m is one of ten slices of 0.6 m, the seventh."""
    words = ["areas.subsets=2", "areas.demonstrations=[1,3,9]"]
    settings = read_config(composed(*TINY, *words))[0]
    tables = run_point(settings, Store(tmp_path), lambda line: None)
    areas, cells = tables["areas"], tables["area_map"]
    assert sorted(set(areas["demonstrations"])) == [1, 3]
    assert len(areas) == 2 * 2 * 4
    np.testing.assert_allclose(cells["in_truth"], np.arange(10) == 6, atol=0.01)
    single = areas[areas["method"] == "single"]
    assert (single["regions"] == 1).all()
    assert set(single["iou"]) <= {0.0, 1.0}
    np.testing.assert_array_equal(single["iou"], single["recall"])
    # Slices are equal and the truth is one: the union of k with the truth is k, or k + 1.
    hit, count = areas["recall"], areas["regions"]
    np.testing.assert_allclose(areas["iou"], hit / np.where(hit > 0, count, count + 1), atol=0.01)
    some = count > 0
    np.testing.assert_allclose(areas["precision"][some], (hit / count)[some], atol=0.01)
    assert areas["precision"][~some].isna().all()
    climb = areas[areas["method"] == "climb"].groupby("demonstrations")["regions"].mean()
    for size in (1, 3):
        assert cells[f"climb_{size}"].sum() == pytest.approx(climb[size])
    assert cells["climb_9"].isna().all()  # three were kept


@pytest.mark.parametrize("more", [[], ["inference.shapes.count=20"]])
def test_fewer_demonstrations_than_asked_for_leave_a_table_without_rows(
    more: list[str], tmp_path: Path
) -> None:
    words = ["areas.subsets=1", "areas.demonstrations=[9]", "inference.shapes.samples=50"]
    settings = read_config(composed(*TINY, *words, *more))[0]
    tables = run_point(settings, Store(tmp_path), lambda line: None)
    assert not len(tables["areas"])
    assert {"demonstrations", "method", "iou"} <= set(tables["areas"].columns)
    assert tables["area_map"]["climb_9"].isna().all()


def test_each_subset_has_the_answer_of_its_own_demonstrations(tmp_path: Path) -> None:
    """Each demonstration speaks for a slice of its own, the second for the wall."""
    words = ["areas.subsets=3", "areas.demonstrations=[1]", "areas.log_odds=3"]
    settings = read_config(composed(*TINY, *words))[0]
    point = infer_point(settings, Store(tmp_path))
    alpha, violated = np.ones((3, 10)), np.zeros((3, 10), dtype=bool)
    alpha[np.arange(3), [5, 6, 7]] = 0.1
    inference = replace(point.inference, avoidance=alpha, violated=violated)
    tables = area_tables(settings, replace(point, inference=inference))
    rng = stream(settings.seed, Purpose.AREAS, 0)
    (subsets,) = random_subsets(3, 1, 3, rng)
    single = tables["areas"].query("method == 'single'")
    assert single["iou"].tolist() == (subsets[:, 0] == 1).astype(float).tolist()
    assert 0 < single["iou"].sum() < 3
    climb = tables["areas"].query("method == 'climb'")["regions"]
    assert climb.mean() > 0
    assert tables["area_map"]["climb_1"].sum() == pytest.approx(climb.mean())


def test_a_point_of_the_raster_belongs_to_the_first_hypothesis_that_holds_it(
    tmp_path: Path,
) -> None:
    """0.3 to 0.9 m and 0.6 to 1.2 m overlap; what is elsewhere belongs to none."""
    slices = "[{lower: [0.3, null], upper: [0.9, null]}, {lower: [0.6, null], upper: [1.2, null]}]"
    words = ["hypotheses.shape=null", f"hypotheses.boxes={slices}", "inference.shapes.count=4"]
    settings = read_config(composed(*TINY, *words, "inference.shapes.samples=10"))[0]
    ways = ShapeWays.of(settings, infer_point(settings, Store(tmp_path)))
    assert ways is not None
    place = ways.evidence.raster.centers[:, 0]
    expected = np.select([(place > 0.3) & (place < 0.9), (place > 0.6) & (place < 1.2)], [0, 1], 2)
    np.testing.assert_array_equal(ways.cell, expected)
    assert set(expected.tolist()) == {0, 1, 2}
    np.testing.assert_array_equal(ways.truth, (place > 0.6) & (place < 1.2))


def test_a_truth_that_hypotheses_cover_in_part(tmp_path: Path) -> None:
    """Slices 0.3 to 0.8 m and on to 1 m; of the wall, 0.6 to 1.2 m, neither has a third."""
    slices = "[{lower: [0.3, null], upper: [0.8, null]}, {lower: [0.8, null], upper: [1.0, null]}]"
    words = ["hypotheses.shape=null", f"hypotheses.boxes={slices}"]
    words += ["areas.subsets=1", "areas.demonstrations=[1]"]
    tables = run_point(read_config(composed(*TINY, *words))[0], Store(tmp_path), lambda line: None)
    np.testing.assert_allclose(tables["area_map"]["in_truth"], [0.4, 1.0], atol=0.03)
    single = tables["areas"].set_index("method").loc["single"]
    assert single["recall"] == pytest.approx(1 / 3, abs=0.03)  # 0.2 m of 0.6 m
    other = 0.2 / single["precision"] - 0.2  # of the slice that comes first
    assert single["iou"] == pytest.approx(0.2 / (0.6 + other), abs=0.03)


SHAPES = ["inference.shapes.count=60", "inference.shapes.samples=40"]


def test_areas_of_shapes_and_their_ceilings(tmp_path: Path) -> None:
    """Slices of x: shapes are free in velocity, as hypotheses are, and so is the wall."""
    words = ["areas.subsets=1", "areas.demonstrations=[1,3]", "inference.shapes.apart=true"]
    words += ["hypotheses.shape=[10,null]", *SHAPES]
    settings, lines = read_config(composed(*TINY, *words))[0], []
    tables = run_point(settings, Store(tmp_path), lines.append)
    assert "chosen" in set(tables["areas"].query("demonstrations == 1")["method"])
    rows = tables["areas"].query("demonstrations == 3").set_index("method")
    assert {"shapes", "likeliest", "shown"} <= set(rows.index)
    # On 2304 points in x alone the wall is a tenth; what is shown of it is all or nothing.
    assert rows.loc["shown", "iou"] in (0.0, 1.0)
    assert 0 <= rows.loc["shapes", "iou"] <= 1
    assert 0 < rows.loc["shapes", "expected"] < 1
    assert np.isnan(rows.loc["climb", "expected"])
    cells, area = tables["area_map"], tables["area"]
    assert cells["shapes_3"].between(0, 1).all()
    assert list(area.columns) == ["point", "position", "chance", "inside"]
    assert len(area) == 2304
    assert area["chance"].between(0, 1).all()
    assert area["inside"].any()
    (told,) = (line for line in lines if line.startswith("area"))
    assert "of one or two shapes; expected overlap" in told
    assert any("forbidden somewhere with at least" in line for line in lines)


def test_scores_of_some_demonstrations_are_those_of_them_alone(tmp_path: Path) -> None:
    """Of four shapes two are likelier than one, as their prior is so."""
    words = ["hypotheses.shape=[10,null]"]
    words += ["inference.shapes.count=4", "inference.shapes.samples=20"]
    settings = read_config(composed(*TINY, *words))[0]
    point = infer_point(settings, Store(tmp_path))
    ways = ShapeWays.of(settings, point)
    assert ways is not None
    violated = np.zeros((3, 4), dtype=bool)
    violated[0] = True  # the first demonstration alone would exclude all shapes
    ways = replace(
        ways,
        evidence=replace(ways.evidence, violated=violated),
        truth=np.ones_like(ways.truth),  # so that recall is a share of points
    )
    rows, share = ways.scores(np.array([1]), (0, 1))
    assert 0 < rows["shapes"]["recall"] == pytest.approx(np.mean(share[ways.cell]))
    belief = infer_area(ways.evidence.of_some([1]), np.random.default_rng(0), sizes(settings))
    assert len(belief.shapes) == 2
    first, second = (ways.evidence.inside[:, i] for i in belief.shapes)
    assert rows["likeliest"]["recall"] == pytest.approx(np.mean(first | second))


def test_a_perfect_belief_finds_what_an_ideal_world_forbids() -> None:
    """Two shapes, one in the way of every trajectory but one: that one is shown."""
    inside = np.zeros((6, 2), dtype=bool)
    inside[:2, 0] = inside[4:, 1] = True
    avoided = np.zeros((5, 2), dtype=bool)
    avoided[3] = True
    raster = Grid(StateSpace(Box([0.0], [6.0]), [False], ("place",)), (6,))
    evidence = ShapeEvidence((avoided,), np.ones((1, 2), dtype=bool), inside, raster, Rates(0.1))
    world = ideal_world(evidence, np.random.default_rng(0))
    assert world is not None
    seen, truth = world
    assert not seen.violated.any()
    np.testing.assert_array_equal(truth, inside.any(axis=1))
    unable = replace(evidence, avoided=(None,))
    assert ideal_world(unable, np.random.default_rng(0)) is None
    walled = replace(evidence, avoided=(np.zeros((5, 2), dtype=bool),))
    assert ideal_world(walled, np.random.default_rng(0)) is None
    both = replace(walled, avoided=(walled.avoided[0], avoided), violated=np.ones((2, 2), bool))
    assert ideal_world(both, np.random.default_rng(0)) is None
    spared = ideal_world(both, np.random.default_rng(0), spare=True)
    assert spared is not None
    assert spared[0].avoided[0] is None
    assert spared[0].avoided[1] is avoided
    assert not spared[0].violated.any()


def test_overlaps_of_areas() -> None:
    area, truth = np.array([1, 1, 1, 0], bool), np.array([0, 0, 1, 1], bool)
    assert overlap_scores(area, truth) == {
        "iou": 1 / 4,
        "precision": 1 / 3,
        "recall": 1 / 2,
    }
    nothing = np.zeros(4, dtype=bool)
    assert np.isnan(overlap_scores(nothing, truth)["precision"])
    assert np.isnan(overlap_scores(nothing, nothing)["iou"])
