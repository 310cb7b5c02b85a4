"""Commands that look back at what nobody's sweep has written: they say so, and do not break."""

import io
import json
import os
import stat
import sys
from pathlib import Path
from typing import Any

import pytest
from commands import run_here
from hand_made import alter, hand_made

from experiments import results
from experiments.collate.join import collate
from experiments.lookback.archive import value_of
from experiments.tracking.files import digest
from experiments.tracking.points import Point
from experiments.tracking.sealed import read_sealed, write_sealed
from experiments.tracking.study import write_plan

DEEP = json.loads('{"a":' * 450 + "0" + "}" * 450)
COMMANDS = (
    *("status", "list", "list s", "list points", "show s", "show {}", "diff {} {}", "query dt=0.5"),
    *("export s", "page {}", "demonstrations {} --out recorded", "clean", "empty-trash"),
)


@pytest.fixture
def point(tmp_path: Path) -> Point:
    """The one point of the study `s`, which is whole."""
    point = hand_made(tmp_path / "results", record={"stages": {"demonstrations": "0" * 32}})
    write_plan(tmp_path / "results" / "s", [(point, ["seed=0"])])
    collate([point], tmp_path / "results" / "s")
    return point


def tell(folder: Path, line: str) -> tuple[int, str]:
    """Exit status of a command, and all that it says."""
    words = [*line.split(), "--results", str(folder / "results")]
    done = run_here(results.main, *words, folder=folder)
    return done.returncode, done.stdout + done.stderr


def check_all(folder: Path, identity: str) -> str:
    """Call every command; none breaks. Returns what `status` says."""
    for command in COMMANDS:
        status, text = tell(folder, command.format(identity, identity))
        assert status in (0, 2), text
        assert status == 0 or text
    return tell(folder, "status")[1]


@pytest.mark.parametrize(
    "change",
    [
        {"seconds": None},
        {"seconds": {"total": "long"}},
        {"started": None},
        {"source": 5},
        {"git": {"diff": None}},
        {"attempt": [1]},
        {"config": DEEP},
        {"host": DEEP},
    ],
    ids=lambda change: f"{str(change)[:30]}",
)
def test_a_forged_record_does_not_count(
    change: dict[str, Any], point: Point, tmp_path: Path
) -> None:
    alter(point.folder / "record.json", **change)
    assert f"{point.identity[:12]} does not count: " in check_all(tmp_path, point.identity)


@pytest.mark.parametrize("key", ["commits", "sources", "attempts", "started", "tables", "points"])
def test_a_forged_listing_does_not_count(key: str, point: Point, tmp_path: Path) -> None:
    path = tmp_path / "results" / "s" / "study.json"
    alter(path, collated={**read_sealed(path)["collated"], key: 3})
    runs = path.with_name("runs.json")
    if key in read_sealed(runs):
        alter(runs, **{key: 3})
    assert "study.json" in check_all(tmp_path, point.identity)


def test_odd_tables_notes_and_stages_are_told(point: Point, tmp_path: Path) -> None:
    for data in (b"a,b\n1\n", b"a\n1,2,3\n", b"\xff\n\xfe\n", b"", b"a\n!!timestamp x\n"):
        (point.folder / "summary.csv").write_bytes(data)
        files = read_sealed(point.folder / "record.json")["files"]
        alter(point.folder / "record.json", files={**files, "summary.csv": digest(data)})
        check_all(tmp_path, point.identity)
    write_sealed(point.folder / "failure.json", {"identity": point.identity, "error": DEEP})
    check_all(tmp_path, point.identity)
    alter(point.folder / "record.json", stages={})
    assert "gone; run it again" in tell(tmp_path, f"demonstrations {point.identity} --out x")[1]


def test_a_lock_that_is_a_folder_is_told(point: Point, tmp_path: Path) -> None:
    alter(point.folder / "record.json", source="another")
    (point.folder / ".lock").mkdir()
    assert ".lock: Is a directory" in check_all(tmp_path, point.identity)
    assert "nothing more is cleaned: " in tell(tmp_path, "clean --yes")[1]


@pytest.mark.parametrize(
    "text", ["2020-13-45", "!!timestamp x", "[" * 3000, "!!int x", "!!float x", "9" * 5000]
)
def test_values_that_yaml_cannot_make_are_words(text: str) -> None:
    assert value_of(text) == (float("inf") if text[0] == "9" else text)


@pytest.mark.parametrize("command", ["export s", "export s --format parquet"])
@pytest.mark.parametrize("kind", ["pipe", "folder", "below a file", "link to itself"])
def test_what_cannot_be_written_is_told_and_stays(
    kind: str, command: str, point: Point, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    if kind == "pipe":
        os.mkfifo(out)
    elif kind == "folder":
        out.mkdir()
    elif kind == "link to itself":
        out.symlink_to(out)
    else:
        out.write_text("")
        out = out / "inner"
    before = (tmp_path / "out").lstat()
    status, text = tell(tmp_path, f"{command} --out {out}")
    if kind != "link to itself":
        assert status == 2
        assert f"--out: {out} " in text
        assert (tmp_path / "out").lstat().st_ino == before.st_ino
        assert stat.S_IFMT((tmp_path / "out").lstat().st_mode) == stat.S_IFMT(before.st_mode)
    assert status in (0, 2)


def test_results_that_are_no_folder_are_told(tmp_path: Path) -> None:
    done = run_here(results.main, "status", "--results", os.devnull, folder=tmp_path)
    assert (done.returncode, done.stderr) == (2, "--results: /dev/null is no folder\n")


def test_names_that_a_terminal_cannot_show_are_spelt_out(
    point: Point, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_plan(tmp_path / "results" / "s", [(point, ["truth.name=\ud800é"])])
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "argv", ["results", "list", "s", "--results", f"{tmp_path}/results"])
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    assert results.main() == 0
    assert rb"truth.name=\ud800\xe9" in raw.getvalue()


def test_a_full_output_is_told(
    point: Point, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(sys, "argv", ["results", "list", "s", "--results", f"{tmp_path}/results"])
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert results.main() == 2
    assert capsys.readouterr().err == "No space left on device\n"


def test_what_is_in_the_place_of_a_point_or_without_its_note_is_told(
    point: Point, tmp_path: Path
) -> None:
    pipe = tmp_path / "results" / "points" / ("0" * 32)
    os.mkfifo(pipe)
    assert f"{pipe}: is no folder, and no point" in tell(tmp_path, "list points")[1]
    (tmp_path / "results" / "s" / "REPORT.md").write_text("")
    assert "report  not up to date: report.json is missing" in tell(tmp_path, "status")[1]
