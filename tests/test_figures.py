"""What figures draw, against the tables that they were given."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_hex
from PIL import Image

from paper_figures import hypothesis_map, rank_curve
from paper_figures.__main__ import draw_study
from paper_figures.origin import SHARED, concerns
from paper_figures.selection import Unsuited
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
            "point": "0123456789abcdef",
            "hypothesis": range(4),
            "lower_angle": lower[:, 0],
            "lower_speed": lower[:, 1],
            "upper_angle": lower[:, 0] + np.pi,
            "upper_speed": lower[:, 1] + 2,
            "feasible": [True, False, True, True],
            "gain": [0.0, -np.inf, 1.5, 6.0],
            "rank": [3.0, 4.0, 2.0, 1.0],
            "posterior": [0.0, 0.0, 0.1, 0.8],
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


def curve_rows() -> pd.DataFrame:
    rows = [
        {"truth": t, "cells": c, "actions": a, "dt": dt, "samples": 1, "demonstrations": n}
        for t in ("c1", "c2")
        for c in (100, 400)
        for a in (5, 9)
        for dt in (0.25, 0.5)
        for n in range(1, 7)
    ]
    table = pd.DataFrame(rows)
    middle = 30 / table["demonstrations"] + table["cells"] / 100 + table["actions"]
    share = 1 - 1 / table["demonstrations"] + table["dt"] / 10
    return table.assign(
        q25=middle - 1,
        median=middle,
        q75=middle + 2,
        median_low=middle - 0.5,
        median_high=middle + 0.25,
        seeds=5,
        share_top_5=share,
        share_top_5_low=share - 0.05,
        share_top_5_high=share + 0.02,
    )


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


def test_rank_curves_are_the_medians_bands_and_shares_of_the_table() -> None:
    table = curve_rows()
    figure = rank_curve.draw(table)
    grid = np.array(figure.axes).reshape(2, 4)
    wanted = table[table["actions"] == 9]
    for (truth, dt), part in wanted.groupby(["truth", "dt"]):
        left, right = grid[[0.25, 0.5].index(dt), 2 * ["c1", "c2"].index(truth) :][:2]
        assert left.get_title(loc="left") == f"{truth.upper()}, $\\Delta t$ = {dt:g} s"
        assert left.get_yscale() == "log"
        for place, (cells, rows) in enumerate(part.groupby("cells")):
            sides = [
                (left, rows["median"], rows["q25"], rows["q75"]),
                (right, *(100 * rows[f"share_top_5{end}"] for end in ("", "_low", "_high"))),
            ]
            for axes, middle, low, high in sides:
                curve = axes.lines[place]
                np.testing.assert_allclose(curve.get_ydata(), middle)
                np.testing.assert_allclose(curve.get_xdata(), rows["demonstrations"])
                assert curve.get_marker() == CELL_MARKS[cells]
                assert to_hex(curve.get_color()) == CELL_COLOURS[cells]
                edges = axes.collections[place].get_paths()[0].vertices
                for x, least, most in zip(rows["demonstrations"], low, high, strict=True):
                    at = edges[edges[:, 0] == x, 1]
                    assert (at.min(), at.max()) == pytest.approx((least, most))
    said = rank_curve.facts(table)
    row = wanted[(wanted["demonstrations"] == 6) & (wanted["cells"] == 400)].iloc[-1]
    assert (
        f"C2, 400 cells, dt 0.5 s: median rank {row['median']:.3g} ({row['median_low']:.3g} to "
        f"{row['median_high']:.3g}), in the top 5 {100 * row['share_top_5']:.0f} %"
    ) in said


def test_rows_that_would_lie_on_one_another_are_not_drawn() -> None:
    twice = pd.concat([curve_rows().assign(temperature=t) for t in (1, 2)])
    with pytest.raises(Unsuited, match="rows differ in more than truth, cells, dt"):
        rank_curve.draw(twice)


def test_the_same_tables_make_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        save(rank_curve.draw(curve_rows()), tmp_path / name / "curve")
    for suffix in (".png", ".pdf"):
        one, two = ((tmp_path / name / f"curve{suffix}").read_bytes() for name in ("one", "two"))
        assert one == two


def write_tables(study: Path, tables: dict[str, pd.DataFrame]) -> dict[str, str]:
    """Write the tables of a study; returns their digests by file."""
    (study / "tables").mkdir()
    for name, table in tables.items():
        table.to_csv(study / "tables" / f"{name}.csv", index=False)
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (study / "tables").iterdir()
    }


def test_a_study_is_drawn_from_its_tables_alone(tmp_path: Path) -> None:
    map_tables = {
        "example_ranking": hypothesis_rows(),
        "example_paths": path_rows(),
        "dimensions": dimension_rows(),
    }
    digests = write_tables(tmp_path, {**map_tables, "rank_curve": curve_rows()})
    drawn = draw_study(tmp_path)
    assert [path.name for path in drawn] == ["rank_curve.png", "hypothesis_map_c1.png"]
    note = json.loads((tmp_path / "figures" / "figures.json").read_text())["figures"]
    assert note["rank_curve"]["tables"] == {"rank_curve.csv": digests.pop("rank_curve.csv")}
    assert note["hypothesis_map_c1"]["tables"] == digests
    for png in drawn:
        files = {png.with_suffix(suffix).name for suffix in (".png", ".pdf", ".txt")}
        assert set(note[png.stem]["files"]) == files
        source = f"study {tmp_path.name}, whose points are not listed"
        assert Image.open(png).text["Source"] == source
        assert png.with_suffix(".txt").read_text().endswith(f"\nSource: {source}.\n")
    assert concerns(tmp_path) == {"hypothesis_map_c1": [], "rank_curve": []}


def test_a_figure_without_its_table_stays_listed_and_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tables(tmp_path, {"rank_curve": curve_rows()})
    with pytest.raises(Unsuited, match=r"run the study first, python .* experiment=empty"):
        draw_study(tmp_path / "empty")
    assert [path.name for path in draw_study(tmp_path)] == ["rank_curve.png"]
    assert capsys.readouterr().out == ""
    table = tmp_path / "tables" / "rank_curve.csv"
    table.write_text(curve_rows().drop(columns="q75").to_csv(index=False))
    with pytest.raises(Unsuited, match="table rank_curve has no column q75"):
        draw_study(tmp_path)
    assert "not drawn again: rank_curve: table rank_curve has no" in capsys.readouterr().out
    table.unlink()
    assert concerns(tmp_path)["rank_curve"] == ["table rank_curve.csv is missing"]


def test_figures_share_only_the_modules_that_their_freshness_depends_on() -> None:
    for path in Path(hypothesis_map.__file__).parent.glob("*.py"):
        if path.stem != "__main__":
            imported = re.findall(r"^from paper_figures\.(\w+) import", path.read_text(), re.M)
            assert set(imported) <= set(SHARED), path
