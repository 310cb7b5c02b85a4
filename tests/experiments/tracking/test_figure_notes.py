"""The sources of figures: what is listed of each, and what makes it out of date."""

import dataclasses
import json
from pathlib import Path

import pytest

from experiments.tracking import figure_notes, sources
from experiments.tracking.figure_notes import concerns, figure_note, sentence, write_note
from experiments.tracking.study import Collated, write_collated

COLLATED = Collated(
    points=("aa" * 16, "bb" * 16),
    sources={"1234": 2},
    systems=("mlci.systems",),
    made_by="5678",
    commits=("0123456789abcdef",),
    dirty=False,
    started=("2026-01-01T00:00:00", "2026-01-02T00:00:00"),
    seconds=1.0,
    peak_memory_mb=100,
    machines=("a machine",),
    versions=("numpy 2.0.0",),
    tables={},
)


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A study with one figure, drawn by a module of its own that imports another."""
    package = tmp_path / "code" / "drawing_of_test"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "curve.py").write_text("from drawing_of_test import style\n")
    (package / "style.py").write_text("WIDTH = 1\n")
    (package / "map.py").write_text("WIDTH = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path / "code"))
    monkeypatch.setattr(figure_notes, "_FIGURES", "drawing_of_test")
    folder = tmp_path / "study"
    (folder / "figures").mkdir(parents=True)
    (folder / "tables").mkdir()
    (folder / "tables" / "trials.csv").write_text("trial\n1\n")
    for suffix in figure_notes.SUFFIXES:
        (folder / "figures" / f"curve_c1{suffix}").write_text(suffix)
    tables = {"trials.csv": (folder / "tables" / "trials.csv").read_bytes()}
    write_note(folder, {"curve_c1": figure_note(folder / "figures" / "curve_c1", "curve", tables)})
    return folder


@pytest.mark.parametrize(
    ("file", "text", "reasons"),
    [
        ("study/tables/other.csv", "trial\n", []),
        ("study/tables/trials.csv", "trial\n2\n", ["table trials.csv has changed since"]),
        ("study/tables/trials.csv", None, ["table trials.csv is missing"]),
        ("study/figures/curve_c1.txt", "", ["curve_c1.txt was changed after it was drawn"]),
        ("study/figures/curve_c1.png", None, ["curve_c1.png is missing"]),
        ("code/drawing_of_test/map.py", "WIDTH = 2\n", []),
        ("code/drawing_of_test/curve.py", "", ["the code that draws has changed since"]),
        ("code/drawing_of_test/style.py", "WIDTH = 2\n", ["the code that draws has changed since"]),
        ("code/drawing_of_test/curve.py", None, ["the code that draws has changed since"]),
    ],
)
def test_figure_is_out_of_date_once_a_source_changes(
    file: str, text: str | None, reasons: list[str], study: Path, tmp_path: Path
) -> None:
    assert concerns(study) == {"curve_c1": []}
    if text is None:
        (tmp_path / file).unlink()
    else:
        (tmp_path / file).write_text(text)
    for cached in sources.CACHES:
        cached.cache_clear()
    assert concerns(study) == {"curve_c1": reasons}


def test_study_without_a_list_has_no_concerns(tmp_path: Path) -> None:
    assert concerns(tmp_path) == {}
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "figures.json").write_text('{"figures": []}')
    assert concerns(tmp_path) == {}


def test_sentence_names_points_and_commit(tmp_path: Path) -> None:
    assert sentence(tmp_path) == f"study {tmp_path.name}, whose points are not listed"
    write_collated(tmp_path, COLLATED)
    assert sentence(tmp_path) == (
        f"study {tmp_path.name}, 2 points (digest cc740c0404dd), git commit 0123456789ab"
    )
    write_collated(
        tmp_path, dataclasses.replace(COLLATED, points=("aa" * 16,), dirty=True, commits=())
    )
    assert ", 1 point (digest " in sentence(tmp_path)
    assert "git commit unknown, with changes" in sentence(tmp_path)


def test_note_lists_the_origin_of_the_data(study: Path) -> None:
    note = json.loads((study / "figures" / "figures.json").read_bytes())
    assert note["study"] is None
    write_collated(study, COLLATED)
    write_note(study, note["figures"])
    note = json.loads((study / "figures" / "figures.json").read_bytes())
    assert note["study"]["count"] == 2
    assert note["study"]["sources"] == {"1234": 2}
    assert "started" not in note["study"]  # the same figure whenever it is drawn
