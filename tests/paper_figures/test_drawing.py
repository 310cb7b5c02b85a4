"""Figures of studies on disk: which are drawn, in how many processes, and what comes with them."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from figure_study import curve_rows, study_tables
from PIL import Image
from sweeps import gone

from experiments.config.paths import CHECKOUT
from experiments.tracking.figure_notes import concerns
from experiments.tracking.sealed import write_sealed
from paper_figures import hypothesis_map, rank_curve, state_space
from paper_figures.__main__ import main
from paper_figures.drawing import FIGURES, Drawing, draw_studies

STATE_SPACE = {name: study_tables()[name] for name in state_space.TABLES}
# Three figures, one of them drawn for each truth; tests/paper_figures/test_look.py draws all.
FEW = (state_space, hypothesis_map, rank_curve)
FEW_TABLES = {name: study_tables()[name] for module in FEW for name in module.TABLES}


def write_tables(study: Path, tables: dict[str, pd.DataFrame]) -> dict[str, str]:
    """Write the tables of a study; returns their digests by file."""
    (study / "tables").mkdir(parents=True)
    for name, table in tables.items():
        table.to_csv(study / "tables" / f"{name}.csv", index=False)
    return {path.name: sha256(path) for path in (study / "tables").iterdir()}


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def draw(study: Path) -> Drawing:
    (drawing,) = draw_studies([study])
    return drawing


def test_a_study_is_drawn_from_its_tables_alone(tmp_path: Path) -> None:
    digests = write_tables(tmp_path, FEW_TABLES)
    (drawing,) = draw_studies([tmp_path], jobs=2)
    images = drawing.images
    names = {path.stem for path in images}
    assert names == {"state_space", "rank_curve", "hypothesis_map_c1", "hypothesis_map_c2"}
    notes = json.loads((tmp_path / "figures" / "figures.json").read_text())["figures"]
    assert set(notes) == names
    for png in images:
        note = notes[png.stem]
        tables = FIGURES[note["module"]].TABLES
        assert note["tables"] == {f"{name}.csv": digests[f"{name}.csv"] for name in tables}
        files = [png.with_suffix(suffix) for suffix in (".png", ".pdf", ".txt")]
        assert note["files"] == {file.name: sha256(file) for file in files}
    assert concerns(tmp_path) == {name: [] for name in sorted(names)}
    listed = {"figures.json", *(file for note in notes.values() for file in note["files"])}
    assert {path.name for path in (tmp_path / "figures").iterdir()} == listed


def test_any_number_of_processes_writes_the_same_files(tmp_path: Path) -> None:
    contents = []
    for jobs in (1, 2):
        studies = [tmp_path / str(jobs) / name for name in ("one", "two")]
        for study in studies:
            write_tables(study, STATE_SPACE)
        drawings = list(draw_studies(studies, jobs))
        images = [[study / "figures" / "state_space.png"] for study in studies]
        assert [(drawing.study, drawing.images) for drawing in drawings] == list(
            zip(studies, images, strict=True)
        )
        files = (path for study in studies for path in sorted((study / "figures").iterdir()))
        contents.append({path.relative_to(tmp_path / str(jobs)): sha256(path) for path in files})
    assert contents[0] == contents[1]
    assert len(contents[0]) == 2 * 4


def test_every_file_tells_its_origin(tmp_path: Path) -> None:
    digests = write_tables(tmp_path, STATE_SPACE)
    (png,) = draw(tmp_path).images
    sources = [f"study {tmp_path.name}, whose points are not listed"]
    collated = {
        "points": ["a" * 32, "b" * 32],
        "sources": {"s": 2},
        "commits": ["c" * 40],
        "dirty": True,
        "started": ["2026-01-02T03:04:05+00:00", "2026-01-02T03:05:06+00:00"],
        **{"seconds": 1.0, "peak_memory_mb": 1, "machines": [], "versions": []},
        **{"systems": [], "made_by": "", "tables": digests},
    }
    write_sealed(tmp_path / "study.json", {"points": {}, "examples": {}, "collated": collated})
    before = png.read_bytes(), png.with_suffix(".pdf").read_bytes()
    texts = [Image.open(png).text, png.with_suffix(".txt").read_text()]
    draw(tmp_path)
    points = hashlib.sha256(f"{'a' * 32}\n{'b' * 32}".encode()).hexdigest()
    sources.append(
        f"study {tmp_path.name}, 2 points (digest {points[:12]}), git commit cccccccccccc, with "
        "changes"
    )
    assert before != (png.read_bytes(), png.with_suffix(".pdf").read_bytes())
    texts += [Image.open(png).text, png.with_suffix(".txt").read_text()]
    for source, text, facts in zip(sources, texts[::2], texts[1::2], strict=True):
        assert text == {"Title": "state_space", "Source": source}
        assert facts.endswith(f"\n\nSource: {source}.\n")
    # A PDF spells its metadata in clear.
    assert (
        sources[1].replace("(", "\\(").replace(")", "\\)").encode()
        in png.with_suffix(".pdf").read_bytes()
    )
    note = json.loads((tmp_path / "figures" / "figures.json").read_text())
    assert note["study"] == {"points": points, "count": 2} | {
        key: collated[key] for key in ("sources", "commits", "dirty")
    }


def test_only_what_would_change_is_drawn_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def is_drawn(again: bool = False) -> bool:
        before = [path.stat().st_mtime_ns for path in images]
        (drawing,) = draw_studies([tmp_path], again=again)
        assert {*drawing.images} == {*images}
        is_new = before != [path.stat().st_mtime_ns for path in images]
        assert drawing.is_current != is_new
        return is_new

    write_tables(tmp_path, STATE_SPACE)
    images = draw(tmp_path).images
    assert not is_drawn()
    assert is_drawn(again=True)
    images[0].with_suffix(".txt").write_text("by hand")
    assert is_drawn()
    table = tmp_path / "tables" / "example_regions.csv"
    table.write_text(table.read_text() + table.read_text().splitlines()[-1] + "\n")
    assert is_drawn()
    assert not is_drawn()
    of_another = tmp_path / "tables" / "rank_curve.csv"
    of_another.write_text(curve_rows().query("truth == 'c1'").to_csv(index=False))
    images += draw(tmp_path).images[1:]
    assert [path.stem for path in images] == ["state_space", "rank_curve"]
    assert not is_drawn()
    # One that cannot be drawn any more is told of each time.
    of_another.unlink()
    del images[1]
    assert is_drawn()
    assert is_drawn()


def test_a_figure_without_its_table_stays_listed_and_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tables(tmp_path, {**STATE_SPACE, "rank_curve": curve_rows().query("truth == 'c1'")})
    assert [path.name for path in draw(tmp_path).images] == ["state_space.png", "rank_curve.png"]
    assert capsys.readouterr().out == ""
    (tmp_path / "tables" / "rank_curve.csv").unlink()
    assert [path.name for path in draw(tmp_path).images] == ["state_space.png"]
    message = f"{tmp_path.name}: not drawn again: rank_curve: there is no table rank_curve\n"
    assert capsys.readouterr().out == message
    assert concerns(tmp_path) == {
        "rank_curve": ["table rank_curve.csv is missing"],
        "state_space": [],
    }
    table = tmp_path / "tables" / "example_regions.csv"
    table.write_text(STATE_SPACE["example_regions"].drop(columns="region").to_csv(index=False))
    drawing = draw(tmp_path)
    assert drawing.images == []
    assert "table example_regions has no column region" in str(drawing)


def test_the_command_draws_what_is_there_and_refuses_what_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(*words: str) -> int:
        monkeypatch.setattr("sys.argv", ["paper_figures", "--jobs", "1", *words])
        return main()

    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match=rf"no study in {tmp_path}/results: run one first"):
        run()
    write_tables(tmp_path / "results" / "full", STATE_SPACE)
    write_tables(tmp_path / "results" / "poor", {})
    assert run() == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first == f"drawn: {tmp_path}/results/full/figures/state_space.png"
    assert second.startswith(f"nothing to draw: the tables in {tmp_path}/results/poor/tables make ")
    assert run("poor", "full", "--results", str(tmp_path / "results")) == 1
    first, second = capsys.readouterr().out.splitlines()
    assert first.endswith("run the study first, python experiments/run.py -m experiment=poor")
    assert second == f"up to date: {tmp_path}/results/full/figures"
    assert run("full", "--again") == 0
    assert capsys.readouterr().out == f"drawn: {tmp_path}/results/full/figures/state_space.png\n"
    with pytest.raises(SystemExit):
        run("--jobs", "0")
    assert "0 processes draw nothing; -1 is one a core" in capsys.readouterr().err


@pytest.mark.long
def test_ctrl_c_while_processes_draw_ends_all_of_them_quietly(tmp_path: Path) -> None:
    write_tables(tmp_path / "study", study_tables())
    process = subprocess.Popen(
        [sys.executable, "-m", "paper_figures", "--results", str(tmp_path), "--jobs", "2"],
        cwd=CHECKOUT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not list(tmp_path.glob("study/figures/*.png")):
        assert process.poll() is None
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGINT)
    assert process.communicate(timeout=600) == ("", "")
    assert process.returncode == 130
    assert gone(process.pid)
    assert not (tmp_path / "study" / "figures" / "figures.json").exists()
