"""What figures draw, against the tables that they were given."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_hex

from paper_figures import hypothesis_map, rank_curve
from paper_figures.__main__ import draw_study
from paper_figures.style import CELL_COLOURS, CELL_MARKS, TRUTH, save


def dimension_rows() -> pd.DataFrame:
    return pd.DataFrame(
        {
            "truth": "c1",
            "name": ["angle", "speed"],
            "unit": ["rad", "rad/s"],
            "lower": [0.0, -2.0],
            "upper": [2 * np.pi, 2.0],
            "periodic": [True, False],
        }
    )


def hypothesis_rows() -> pd.DataFrame:
    """Two by two cells: one violated, one of no gain, and the truth ranked first."""
    lower = np.array([(a, s) for a in (0.0, np.pi) for s in (-2.0, 0.0)])
    return pd.DataFrame(
        {
            "truth": "c1",
            "cells": 400,
            "actions": 9,
            "dt": 0.25,
            "hypothesis": range(4),
            "lower_angle": lower[:, 0],
            "lower_speed": lower[:, 1],
            "upper_angle": lower[:, 0] + np.pi,
            "upper_speed": lower[:, 1] + 2,
            "feasible": [True, False, True, True],
            "gain": [0.0, -np.inf, 1.5, 6.0],
            "rank": [3.0, 4.0, 2.0, 1.0],
            "covered_by_truth": [False, False, False, True],
        }
    )


def path_rows() -> pd.DataFrame:
    """Two paths, of which the second passes a whole turn."""
    return pd.DataFrame(
        {
            "truth": "c1",
            "demonstration": [0] * 3 + [1] * 4,
            "angle": [0.5, 1.0, 1.5, 5.5, 6.1, 6.6, 7.0],
            "speed": [0.1, 0.2, 0.1, 1.0, 1.1, 1.1, 1.0],
        }
    )


def quantile_rows() -> pd.DataFrame:
    rows = [
        {"truth": t, "cells": c, "actions": 9, "dt": dt, "demonstrations": n}
        for t in ("c1", "c2")
        for c in (100, 400)
        for dt in (0.25, 0.5)
        for n in range(1, 7)
    ]
    table = pd.DataFrame(rows)
    middle = 30 / table["demonstrations"] + table["cells"] / 100
    return table.assign(q25=middle - 1, median=middle, q75=middle + 2)


def test_hypothesis_map_shows_what_the_table_says() -> None:
    figure = hypothesis_map.draw(hypothesis_rows(), path_rows(), dimension_rows())
    axes = figure.axes[0]
    feasible, violated = (c for c in axes.collections if isinstance(c, PatchCollection))
    np.testing.assert_allclose(np.square(feasible.get_array()), [0.0, 1.5, 6.0])
    corners = [path.vertices.min(axis=0) for path in violated.get_paths()]
    np.testing.assert_allclose(corners, [[0.0, 0.0]])
    outlines = {to_hex(patch.get_edgecolor()): patch.get_xy() for patch in axes.patches}
    assert outlines[TRUTH] == pytest.approx((np.pi, 0.0))
    assert [text.get_text() for text in axes.texts] == ["2", "1"]
    assert axes.get_xlabel() == "angle [rad]"
    assert axes.get_ylabel() == "speed [rad/s]"


def test_hypotheses_over_one_dimension_span_the_other() -> None:
    table = hypothesis_rows().assign(lower_speed=-np.inf, upper_speed=np.inf)
    figure = hypothesis_map.draw(table, path_rows(), dimension_rows())
    outlines = {to_hex(patch.get_edgecolor()): patch for patch in figure.axes[0].patches}
    truth = outlines[TRUTH]
    assert truth.get_xy() == pytest.approx((np.pi, -2.0))
    assert (truth.get_width(), truth.get_height()) == pytest.approx((np.pi, 4.0))


def test_a_path_is_broken_where_it_wraps() -> None:
    figure = hypothesis_map.draw(hypothesis_rows(), path_rows(), dimension_rows())
    lines = [line.get_xydata() for line in figure.axes[0].lines if len(line.get_xdata()) > 1]
    np.testing.assert_allclose(lines[0], path_rows()[["angle", "speed"]].to_numpy()[:3])
    second = np.array([5.5, 6.1, np.nan, 6.6 - 2 * np.pi, 7.0 - 2 * np.pi])
    np.testing.assert_allclose(lines[1][:, 0], second)


def test_rank_curves_are_the_medians_and_bands_of_the_table() -> None:
    table = quantile_rows()
    figure = rank_curve.draw(table)
    panels = {axes.get_title(): axes for axes in figure.axes}
    assert len(panels) == 4
    for (truth, dt), part in table.groupby(["truth", "dt"]):
        axes = panels[f"truth {truth.upper()}, $\\Delta t$ = {dt:g} s, 9 actions"]
        curves = {line.get_label(): line for line in axes.lines if "cells" in line.get_label()}
        for cells, rows in part.groupby("cells"):
            curve = curves[f"{cells} cells"]
            np.testing.assert_allclose(curve.get_xydata(), rows[["demonstrations", "median"]])
            assert curve.get_marker() == CELL_MARKS[cells]
            assert to_hex(curve.get_color()) == CELL_COLOURS[cells]
        edges = axes.collections[0].get_paths()[0].vertices[:, 1]
        first = part[part["cells"] == 100]
        assert edges.min() == pytest.approx(first["q25"].min())
        assert edges.max() == pytest.approx(first["q75"].max())
        assert axes.get_yscale() == "log"


def test_the_same_tables_make_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        save(rank_curve.draw(quantile_rows()), tmp_path / name)
    for suffix in (".png", ".pdf"):
        one, two = ((tmp_path / name).with_suffix(suffix).read_bytes() for name in ("one", "two"))
        assert one == two


def test_a_study_is_drawn_from_its_tables_alone(tmp_path: Path) -> None:
    tables = {
        "hypotheses": hypothesis_rows(),
        "paths": path_rows(),
        "dimensions": dimension_rows(),
        "rank_quantiles": quantile_rows(),
    }
    (tmp_path / "tables").mkdir()
    for name, table in tables.items():
        table.to_csv(tmp_path / "tables" / f"{name}.csv", index=False)
    drawn = draw_study(tmp_path)
    assert [path.name for path in drawn] == ["hypotheses_c1.png", "rank_of_the_truth.png"]
    assert all(path.exists() and path.with_suffix(".pdf").exists() for path in drawn)
    note = json.loads((tmp_path / "figures" / "figures.json").read_text())
    digests = {
        f"{name}.csv": hashlib.sha256(
            (tmp_path / "tables" / f"{name}.csv").read_bytes()
        ).hexdigest()
        for name in tables
    }
    assert note["figures"]["rank_of_the_truth"] == {
        "rank_quantiles.csv": digests.pop("rank_quantiles.csv")
    }
    assert note["figures"]["hypotheses_c1"] == digests
    (tmp_path / "tables" / "paths.csv").unlink()
    with pytest.raises(SystemExit, match="no table paths: run the study first"):
        draw_study(tmp_path)
