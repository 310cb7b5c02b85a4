"""Boxes and paths in the plane of two state dimensions."""

from __future__ import annotations

import json
from collections.abc import Callable
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from figure_study import path_rows
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from paper_figures import hypothesis_map
from paper_figures.plane import Plane, centre, outline
from paper_figures.rows import Unsuited
from paper_figures.style import TRUTH

Drawn = Callable[[ModuleType], Figure]
TablesFor = Callable[[ModuleType], dict[str, pd.DataFrame]]


def test_hypotheses_over_one_dimension_span_the_other(tables_for: TablesFor) -> None:
    tables = tables_for(hypothesis_map)
    free = {"lower_speed": -np.inf, "upper_speed": np.inf}
    tables["example_ranking"] = tables["example_ranking"].assign(**free)
    figure = hypothesis_map.draw(**tables)
    outlines = {to_hex(patch.get_edgecolor()): patch for patch in figure.axes[0].patches}
    truth = outlines[TRUTH]
    assert truth.get_xy() == pytest.approx((np.pi, -2.0))
    assert (truth.get_width(), truth.get_height()) == pytest.approx((np.pi, 4.0))


def test_a_path_is_broken_where_it_wraps(drawn: Drawn) -> None:
    lines = [
        line.get_xydata()
        for line in drawn(hypothesis_map).axes[0].lines
        if len(line.get_xdata()) > 1
    ]
    np.testing.assert_allclose(lines[0], path_rows()[["angle", "speed"]].to_numpy()[:3])
    second = np.array([5.5, 6.1, np.nan, 6.6 - 2 * np.pi, 7.0 - 2 * np.pi])
    np.testing.assert_allclose(lines[1][:, 0], second)


def test_one_dimension_has_no_plane(tables_for: TablesFor) -> None:
    tables = tables_for(hypothesis_map)
    tables["example_dimensions"] = tables["example_dimensions"].head(1)
    with pytest.raises(Unsuited, match="a state of one dimension has no plane"):
        hypothesis_map.draw(**tables)


def test_region_that_is_no_box_is_drawn_by_its_rings() -> None:
    axis = {"unit": "m", "lower": 0.0, "upper": 4.0, "periodic": True}
    plane = Plane(pd.Series({"name": "x", **axis}), pd.Series({"name": "y", **axis}))
    ring = [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 1.0]]
    elsewhere = {"dimensions": ["x", "z"], "rings": [ring]}
    triangle = {"dimensions": ["x", "y"], "rings": [ring]}
    regions = pd.DataFrame(
        {
            **{f"lower_{name}": [1.0, 1.0, 3.5] for name in "xy"},
            **{f"upper_{name}": [2.0, 2.0, 4.5] for name in "xy"},
            "outline": [json.dumps(triangle), json.dumps(elsewhere), np.nan],
        }
    )
    shaped, hull, box = plane.rectangles(regions)
    for drawn in (shaped, outline(shaped, "black", 1.0)):
        vertices = drawn.get_transform().transform_path(drawn.get_path()).vertices
        np.testing.assert_array_equal(vertices, ring)
    assert centre(shaped) == (1.5, 1.5)  # where its rank is written
    for each in (hull, box):
        assert type(each) is Rectangle
    assert len(plane.regions(regions.iloc[:1])) == 1  # rings have no copies, and boxes do
    assert len(plane.regions(regions.iloc[2:])) == 4
