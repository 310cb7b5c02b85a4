"""Overlap of sets of hypotheses with a truth, on a world whose areas can be told by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tiny_point import TINY, composed

from experiments.config.read import read_config
from experiments.point.run import run_point
from experiments.tracking.store import Store


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
