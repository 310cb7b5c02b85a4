"""The map of an inference, and what of it is kept: drawn here, and looked at as numbers."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from page_answers import CIRCLE, answer_of

from mlci.plot import TOP, png
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace

REGIONS = Regions.from_grid(CIRCLE, (4, 5))


def test_hypotheses_have_the_colour_of_their_gain_and_the_first_their_rank() -> None:
    answer, paths = answer_of(REGIONS, ["a", "b", "c"])
    inference = answer.inference
    axes = inference.plot(paths)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("angle [rad]", "speed [rad/s]")
    assert axes.get_xlim() == pytest.approx((0, 2 * np.pi))
    shapes, _ = axes.collections
    corners = [path.get_extents().min.round(6).tolist() for path in shapes.get_paths()]
    colours = [to_hex(colour) for colour in shapes.get_facecolor()]
    patches = {tuple(corner): colour for corner, colour in zip(corners, colours, strict=True)}
    assert len(patches) == len(REGIONS)
    shades = {}
    for i, corner in enumerate(REGIONS.lower.round(6).tolist()):
        colour = patches[tuple(corner)]
        assert (colour == "#e8e8e8") == inference.violated[:, i].any()
        if not inference.violated[:, i].any():
            shades[inference.gain[i]] = int(colour[1:3], 16)
    assert list(dict(sorted(shades.items())).values()) == sorted(shades.values(), reverse=True)
    ranks = sorted(float(text.get_text()) for text in axes.texts)
    first = inference.ranking.rank[inference.gain > 0]
    assert ranks == sorted(first[first <= TOP].tolist())
    (ends,) = [line for line in axes.lines if line.get_marker() == "s"]
    assert len(ends.get_xdata()) == 3


def test_a_region_across_the_seam_is_drawn_on_both_sides() -> None:
    across = Regions(CIRCLE, [[-0.5, 0.0]], [[0.5, 1.0]])
    axes = answer_of(across, ["a", "b"])[0].inference.plot()
    left = sorted(path.get_extents().x0 for path in axes.collections[0].get_paths())
    np.testing.assert_allclose(left, [0.0, 2 * np.pi - 0.5])


def test_two_of_many_dimensions_can_be_asked_for() -> None:
    space = StateSpace(Box([0] * 3, [1] * 3), [False] * 3, ("a", "b", "c"), ("m", "", "s"))
    inference = answer_of(Regions.from_grid(space, (2, 3, 4)), ["a", "b"])[0].inference
    axes = inference.plot(dimensions=(2, 1))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("c [s]", "b")


def test_tables_and_map_are_kept(tmp_path: Path) -> None:
    answer, paths = answer_of(REGIONS, ["a", "b", "c"])
    inference = answer.inference
    folder = inference.save(tmp_path / "new" / "answer", paths)
    hypotheses = pd.read_csv(folder / "hypotheses.csv", dtype={"hypothesis": str})
    assert hypotheses["hypothesis"].tolist() == inference.to_frame()["hypothesis"].tolist()
    pairs = pd.read_csv(folder / "evidence.csv")
    assert len(pairs) == inference.evidence.size
    np.testing.assert_allclose(pairs["evidence"], inference.evidence.ravel())
    np.testing.assert_allclose(pairs["probability"], inference.phi.ravel())
    assert pairs.loc[21, ["demonstration", "hypothesis"]].tolist() == ["b", 1]
    assert (folder / "map.png").read_bytes() == png(inference.plot(paths))


def test_a_notebook_shows_the_summary_escaped_and_the_map() -> None:
    names = tuple(f"<b>{i}" for i in range(20))
    regions = Regions(CIRCLE, REGIONS.lower, REGIONS.upper, names)
    shown = answer_of(regions, ["a", "b"])[0].inference._repr_html_()
    assert "&lt;b&gt;" in shown
    assert "<b>" not in shown
    assert re.search(r'<img alt="[^"]+" src="data:image/png;base64,[\w+/=]{1000,}">$', shown)
