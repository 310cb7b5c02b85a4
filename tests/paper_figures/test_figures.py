"""Figures of a study: which are drawn, what comes with them, how they look."""

from __future__ import annotations

import hashlib
import importlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from choice_studies import known_tables
from figure_study import curve_rows, measure_rows, path_rows, scale_rows, study_tables
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

from paper_figures import final_state_error, hypothesis_map, rank_curve, state_space
from paper_figures.drawing import FIGURES, draw_study
from paper_figures.figure_notes import SHARED, concerns
from paper_figures.rows import Unsuited
from paper_figures.style import CELL_COLOURS, CELL_MARKS, COLUMN, PAGE, TRUTH, save

# Figures of other studies than the paper's.
OTHERS = {**known_tables(), "scale": {"scale": scale_rows()}}


def tables_for(module: ModuleType) -> dict[str, pd.DataFrame]:
    """The known tables that a module needs."""
    known = {**study_tables(), **OTHERS.get(module.__name__.rpartition(".")[2], {})}
    return {name: known[name] for name in module.TABLES}


def of_c1(module: ModuleType) -> dict[str, pd.DataFrame]:
    """The rows of one truth in the tables that a module needs."""
    tables = tables_for(module)
    return {
        name: table[table["truth"] == "c1"].reset_index(drop=True) for name, table in tables.items()
    }


def test_hypotheses_over_one_dimension_span_the_other() -> None:
    tables = of_c1(hypothesis_map)
    free = {"lower_speed": -np.inf, "upper_speed": np.inf}
    tables["example_ranking"] = tables["example_ranking"].assign(**free)
    figure = hypothesis_map.draw(**tables)
    outlines = {to_hex(patch.get_edgecolor()): patch for patch in figure.axes[0].patches}
    truth = outlines[TRUTH]
    assert truth.get_xy() == pytest.approx((np.pi, -2.0))
    assert (truth.get_width(), truth.get_height()) == pytest.approx((np.pi, 4.0))


def test_a_path_is_broken_where_it_wraps() -> None:
    figure = hypothesis_map.draw(**of_c1(hypothesis_map))
    lines = [line.get_xydata() for line in figure.axes[0].lines if len(line.get_xdata()) > 1]
    np.testing.assert_allclose(lines[0], path_rows()[["angle", "speed"]].to_numpy()[:3])
    second = np.array([5.5, 6.1, np.nan, 6.6 - 2 * np.pi, 7.0 - 2 * np.pi])
    np.testing.assert_allclose(lines[1][:, 0], second)


def test_rows_that_would_lie_on_one_another_are_not_drawn() -> None:
    twice = pd.concat([curve_rows().assign(temperature=t) for t in (1, 2)])
    with pytest.raises(Unsuited, match="rows differ in more than truth, cells, dt"):
        rank_curve.draw(twice)


def test_many_truths_and_none_to_rank_are_not_drawn() -> None:
    many = pd.concat([curve_rows().assign(truth=f"cell_{number}") for number in range(5)])
    with pytest.raises(Unsuited, match="5 truths are more than 4 panels"):
        rank_curve.draw(many)
    with pytest.raises(Unsuited, match="there is no truth to rank"):
        rank_curve.draw(curve_rows().assign(median=np.nan))


def test_one_dimension_has_no_plane() -> None:
    tables = of_c1(hypothesis_map)
    tables["example_dimensions"] = tables["example_dimensions"].head(1)
    with pytest.raises(Unsuited, match="a state of one dimension has no plane"):
        hypothesis_map.draw(**tables)


def test_what_does_not_vary_is_no_curve() -> None:
    rows = measure_rows()
    with pytest.raises(Unsuited, match="neither cells nor dt varies"):
        final_state_error.draw(rows[(rows["cells"] == 100) & (rows["dt"] == 0.5)])
    with pytest.raises(Unsuited, match="table measures has no measure final_state_error"):
        final_state_error.draw(rows[rows["measure"] != "final_state_error"])


def test_the_same_tables_make_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one", "two"):
        save(hypothesis_map.draw(**of_c1(hypothesis_map)), tmp_path / name / "map")
    for suffix in (".png", ".pdf"):
        one, two = ((tmp_path / name / f"map{suffix}").read_bytes() for name in ("one", "two"))
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
    digests = write_tables(tmp_path, study_tables())
    drawn = draw_study(tmp_path)
    names = {path.stem for path in drawn}
    single = {module.__name__.rpartition(".")[2] for module in FIGURES}
    single -= {"hypothesis_map", *OTHERS}
    assert names == single | {"hypothesis_map_c1", "hypothesis_map_c2"}
    note = json.loads((tmp_path / "figures" / "figures.json").read_text())["figures"]
    assert set(note) == names
    for png in drawn:
        module = importlib.import_module(f"paper_figures.{note[png.stem]['module']}")
        used = {f"{name}.csv": digests[f"{name}.csv"] for name in module.TABLES}
        assert note[png.stem]["tables"] == used
        files = [png.with_suffix(suffix) for suffix in (".png", ".pdf", ".txt")]
        assert note[png.stem]["files"] == {
            file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files
        }
    assert concerns(tmp_path) == {name: [] for name in sorted(names)}


STATE_SPACE = {name: study_tables()[name] for name in state_space.TABLES}


def test_every_file_tells_its_origin(tmp_path: Path) -> None:
    write_tables(tmp_path, STATE_SPACE)
    (png,) = draw_study(tmp_path)
    sources = [f"study {tmp_path.name}, whose points are not listed"]
    collated = {
        "points": ["a" * 32, "b" * 32],
        "sources": {"s": 2},
        "commits": ["c" * 40],
        "dirty": True,
        "started": ["2026-01-02T03:04:05+00:00", "2026-01-02T03:05:06+00:00"],
    }
    (tmp_path / "study.json").write_text(json.dumps({"collated": collated}))
    before = png.read_bytes(), png.with_suffix(".pdf").read_bytes()
    found = [Image.open(png).text, png.with_suffix(".txt").read_text()]
    draw_study(tmp_path)
    points = hashlib.sha256(f"{'a' * 32}\n{'b' * 32}".encode()).hexdigest()
    sources.append(
        f"study {tmp_path.name}, 2 points (digest {points[:12]}), git commit cccccccccccc, with "
        "changes, data of 2026-01-02T03:05:06+00:00"
    )
    assert before != (png.read_bytes(), png.with_suffix(".pdf").read_bytes())
    found += [Image.open(png).text, png.with_suffix(".txt").read_text()]
    for source, text, facts in zip(sources, found[::2], found[1::2], strict=True):
        assert text == {"Title": "state_space", "Source": source}
        assert facts.endswith(f"\n\nSource: {source}.\n")
    # A PDF spells its metadata in clear.
    assert (
        sources[1].replace("(", "\\(").replace(")", "\\)").encode()
        in png.with_suffix(".pdf").read_bytes()
    )
    note = json.loads((tmp_path / "figures" / "figures.json").read_text())
    assert note["study"] == {"points": points, "count": 2} | {
        key: collated[key] for key in ("sources", "commits", "dirty", "started")
    }


def test_a_figure_without_its_table_stays_listed_and_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tables(tmp_path, {**STATE_SPACE, "rank_curve": curve_rows()})
    with pytest.raises(Unsuited, match=r"run the study first, python .* experiment=empty"):
        draw_study(tmp_path / "empty")
    drawn = [path.name for path in draw_study(tmp_path)]
    assert drawn == ["state_space.png", "rank_curve.png"]
    assert capsys.readouterr().out == ""
    (tmp_path / "tables" / "rank_curve.csv").unlink()
    assert [path.name for path in draw_study(tmp_path)] == ["state_space.png"]
    told = f"{tmp_path.name}: not drawn again: rank_curve: there is no table rank_curve\n"
    assert capsys.readouterr().out == told
    assert concerns(tmp_path) == {
        "rank_curve": ["table rank_curve.csv is missing"],
        "state_space": [],
    }
    table = tmp_path / "tables" / "example_regions.csv"
    table.write_text(STATE_SPACE["example_regions"].drop(columns="region").to_csv(index=False))
    with pytest.raises(Unsuited, match="table example_regions has no column region"):
        draw_study(tmp_path)


def test_figures_share_only_the_modules_that_their_freshness_depends_on() -> None:
    for path in Path(hypothesis_map.__file__).parent.glob("*.py"):
        if path.stem not in ("__main__", "drawing"):
            imported = re.findall(r"^from paper_figures\.(\w+) import", path.read_text(), re.M)
            assert set(imported) <= set(SHARED), path


def test_colours_are_those_of_the_style() -> None:
    for path in Path(hypothesis_map.__file__).parent.glob("*.py"):
        text = path.read_text()
        if path.stem != "style":
            # Black and white apart, a colour has a name in the style module.
            assert not re.findall(r"#[0-9a-fA-F]{3,8}\b|tab:\w+|\bC\d\b", text), path
            assert set(re.findall(r'(?:colou?r|fc|ec)"?[=:] ?"(\w+)"', text)) <= {
                *("black", "white", "none")
            }, path


@pytest.fixture(scope="module")
def figures() -> Iterator[dict[str, Figure]]:
    """Every figure of the known study, at its size in print."""
    found = {}
    for module in FIGURES:
        each = hasattr(module, "EACH")
        tables = of_c1(module) if each else tables_for(module)
        found[module.__name__.rpartition(".")[2]] = module.draw(**tables)
    for figure in found.values():
        figure.canvas.draw()
    yield found
    plt.close("all")


NAMES = [module.__name__.rpartition(".")[2] for module in FIGURES]


@pytest.mark.parametrize("name", NAMES)
def test_labels_have_units(name: str, figures: dict[str, Figure]) -> None:
    figure = figures[name]
    labels = {axes.get_xlabel() for axes in figure.axes} | {a.get_ylabel() for a in figure.axes}
    labels |= {figure.get_supylabel()}
    counted = {"", "demonstrations", "states", "rank of truth", r"$\Phi_i$ of one trial"}
    assert all(re.search(r"\[[^]]+\]$", label) for label in labels - counted), labels


@pytest.mark.parametrize("name", NAMES)
def test_no_text_lies_on_another_or_is_cut(name: str, figures: dict[str, Figure]) -> None:
    figure = figures[name]
    renderer = figure.canvas.get_renderer()
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in shown_texts(figure)]
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


def shown_texts(figure: Figure) -> list[Text]:
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


@pytest.mark.parametrize("name", NAMES)
def test_figures_fit_a_column_or_a_page(name: str, figures: dict[str, Figure]) -> None:
    assert figures[name].get_figwidth() in (COLUMN, PAGE)
    assert min(text.get_fontsize() for text in shown_texts(figures[name])) >= 5


def test_curves_differ_in_grey() -> None:
    red, green, blue = np.array([to_rgb(colour) for colour in CELL_COLOURS.values()]).T
    luminance = np.sort(0.299 * red + 0.587 * green + 0.114 * blue)
    # Two of them are close, and their marks tell them apart.
    assert luminance[-1] - luminance[0] > 0.25
    assert len(set(CELL_MARKS.values())) == len(CELL_MARKS)
