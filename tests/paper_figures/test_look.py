"""How all figures look: one style, units, legible text, the same bytes each time."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text

from experiments.config.paths import CHECKOUT
from paper_figures import hypothesis_map
from paper_figures.drawing import FIGURES
from paper_figures.style import CELL_COLOURS, CELL_MARKS, COLUMN, PAGE, save, whiskers

Drawn = Callable[[ModuleType], Figure]
TablesFor = Callable[[ModuleType], dict[str, pd.DataFrame]]


def test_the_same_tables_make_the_same_bytes(tmp_path: Path, tables_for: TablesFor) -> None:
    for name in ("one", "two"):
        save(hypothesis_map.draw(**tables_for(hypothesis_map)), tmp_path / name / "map")
    for suffix in (".png", ".pdf"):
        one, two = ((tmp_path / name / f"map{suffix}").read_bytes() for name in ("one", "two"))
        assert one == two


def test_colours_are_those_of_the_style() -> None:
    for path in Path(hypothesis_map.__file__).parent.glob("*.py"):
        text = path.read_text()
        if path.stem != "style":
            # Black and white apart, a colour has a name in the style module.
            assert not re.findall(r"#[0-9a-fA-F]{3,8}\b|tab:\w+|\bC\d\b", text), path
            assert set(re.findall(r'(?:colou?r|fc|ec)"?[=:] ?"(\w+)"', text)) <= {
                *("black", "white", "none")
            }, path


@pytest.fixture(scope="module", params=FIGURES)
def figure(request: pytest.FixtureRequest, drawn: Drawn) -> Figure:
    """Each figure, laid out at its size in print."""
    figure = drawn(FIGURES[request.param])
    figure.canvas.draw()
    return figure


def test_labels_have_units(figure: Figure) -> None:
    labels = {axes.get_xlabel() for axes in figure.axes} | {a.get_ylabel() for a in figure.axes}
    labels |= {figure.get_supylabel()}
    counted = {"", "demonstrations", "states", "cells", "rank of truth", r"$\Phi_i$ of one trial"}
    assert all(re.search(r"\[[^]]+\]$", label) for label in labels - counted), labels


def test_no_text_lies_on_another_or_is_cut(figure: Figure) -> None:
    renderer = figure.canvas.get_renderer()
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in visible_texts(figure)]
    assert len(boxes) > 5
    for place, (one, box) in enumerate(boxes):
        assert box.x0 >= 0, one
        assert box.y0 >= 0, one
        assert box.x1 <= figure.bbox.x1, one
        assert box.y1 <= figure.bbox.y1, one
        for two, other in boxes[:place]:
            apart = min(box.x1, other.x1) <= max(box.x0, other.x0) + 0.5
            apart |= min(box.y1, other.y1) <= max(box.y0, other.y0) + 0.5
            assert apart, (one, two)


def test_figures_fit_a_column_or_a_page(figure: Figure) -> None:
    assert figure.get_figwidth() in (COLUMN, PAGE)
    assert min(text.get_fontsize() for text in visible_texts(figure)) >= 5


def visible_texts(figure: Figure) -> list[Text]:
    """The texts of a figure that can be seen; a tick beyond its axis cannot."""
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in [*axis.get_major_ticks(), *axis.get_minor_ticks()]:
                slack = 1e-9 * (high - low)
                if not low - slack <= tick.get_loc() <= high + slack:
                    hidden |= {tick.label1, tick.label2}
    texts = figure.findobj(Text)
    return [t for t in texts if t.get_visible() and t.get_text().strip() and t not in hidden]


def test_curves_differ_in_grey() -> None:
    red, green, blue = np.array([to_rgb(colour) for colour in CELL_COLOURS.values()]).T
    luminance = np.sort(0.299 * red + 0.587 * green + 0.114 * blue)
    # Two of them are close, and their marks tell them apart.
    assert luminance[-1] - luminance[0] > 0.25
    assert len(set(CELL_MARKS.values())) == len(CELL_MARKS)


def test_an_interval_that_does_not_hold_its_mark_has_no_line_on_that_side() -> None:
    """As a share of 100 % whose upper end is rounded to a little less."""
    lengths = whiskers([0.5, 1.0], [0.25, 0.75], [0.625, 1 - 1e-16])
    np.testing.assert_array_equal(lengths, [[0.25, 0.25], [0.125, 0.0]])


def test_a_users_own_matplotlibrc_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nlines.linestyle: --\n")
    code = (
        "import paper_figures.style, matplotlib\n"
        "assert matplotlib.rcParams['text.usetex'] is False\n"
        "assert matplotlib.rcParams['lines.linestyle'] == '-'\n"
    )
    environment = {**os.environ, "MATPLOTLIBRC": str(tmp_path / "matplotlibrc")}
    subprocess.run([sys.executable, "-c", code], check=True, cwd=CHECKOUT, env=environment)
