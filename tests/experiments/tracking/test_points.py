"""What a point on disk is, and what its files say about it; no science is needed for that."""

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from tiny_point import composed, planned

from experiments.config.read import read_config
from experiments.tracking.files import digest
from experiments.tracking.points import Point, State

# Changing this makes every point of every study anew: only when what a point is has changed.
DEFAULT_POINT = "33274a1c67e4ed0e53c7ff989125ac1e"
CONFIG = {"dt": 0.5, "system": {"target": "mlci.systems.Pendulum", "arguments": {}}}
HOLDER = """
import sys, time
from filelock import FileLock
with FileLock(sys.argv[1]):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def point(tmp_path: Path) -> Point:
    return Point.planned(CONFIG, tmp_path)


def write(point: Point, name: str, **content: Any) -> None:
    """A note of a point as an attempt leaves it."""
    point.folder.mkdir(parents=True, exist_ok=True)
    point.write_note(name, {"identity": point.identity, "source": point.source, **content})


def finish(point: Point, **changes: Any) -> None:
    """A record of one table."""
    point.folder.mkdir(parents=True, exist_ok=True)
    (point.folder / "trials.csv").write_bytes(b"trial\n")
    files = {"trials.csv": digest(b"trial\n")}
    content = {"files": files, "config": CONFIG, "stages": {}, "git": {"diff": None}}
    write(point, "record", **{**content, **changes})


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["workers=7", "study=other", "results=/elsewhere", "sweep.retries=3", "sweep.force=true"],
        ["grid.shape=[20,20]", "dt=25e-2", "horizon=5", "seed=0", "transition.samples=1"],
        ["grid='100'", "grid.shape=[20,20]", "truth=c1", "system=pendulum"],
    ],
)
def test_identity_is_pinned_whatever_the_spelling(overrides: list[str]) -> None:
    assert planned(read_config(composed(*overrides))[0], Path()).identity == DEFAULT_POINT


def test_identity_is_that_of_the_config_alone(tmp_path: Path) -> None:
    point = Point.planned(CONFIG, tmp_path)
    assert point == Point(tmp_path, point.identity) == Point.planned({**CONFIG}, tmp_path)
    assert point != Point.planned({**CONFIG, "dt": 0.25}, tmp_path)
    assert point != Point.planned(CONFIG, tmp_path / "elsewhere")
    assert point.folder == tmp_path / "points" / point.identity


def test_point_known_by_name_has_the_config_of_its_record(point: Point) -> None:
    assert Point(point.results, point.identity).config == {}
    finish(point)
    known = Point(point.results, point.identity)
    assert known.config == point.config == CONFIG
    assert known.source == point.source != Point.planned({}, point.results).source
    assert known.is_done()


def test_state_follows_what_is_on_disk(point: Point) -> None:
    assert point.state() is State.MISSING
    assert not point.folder.exists()
    write(point, "attempt", attempt=1)
    assert point.state() is State.MISSING
    write(point, "failure", attempt=1)
    assert point.state() is State.FAILED
    finish(point, source="before an edit")
    assert point.state() is State.STALE
    with point.lock:
        assert point.state() is State.RUNNING
    finish(point)
    assert point.state() is State.DONE
    with point.lock:  # it runs again
        assert point.state() is State.DONE


@pytest.mark.parametrize(
    "harm",
    [
        lambda folder: (folder / "trials.csv").write_bytes(b"trial\n1\n"),
        lambda folder: (folder / "trials.csv").unlink(),
        lambda folder: (folder / "record.json").write_text("{"),
        lambda folder: (folder / "record.json").write_text('{"files": {}}'),
        lambda folder: (folder / "record.json").write_text('{"identity": "another"}'),
        lambda folder: (folder / "record.json").write_text("[]"),
    ],
)
def test_damaged_point_is_missing(harm: Any, point: Point) -> None:
    finish(point)
    harm(point.folder)
    assert point.record() is None
    assert point.state() is State.MISSING


def test_done_counts_attempts_after_one(point: Point) -> None:
    assert not point.is_done()
    finish(point, attempt=2)
    assert [point.is_done(after) for after in (0, 1, 2)] == [True, True, False]
    finish(point, attempt=2, source="another")
    assert not point.is_done()


def test_number_of_attempts_is_that_of_the_last_however_it_ended(point: Point) -> None:
    assert point.attempts() == 0
    finish(point, attempt=1)
    assert point.attempts() == 1
    write(point, "failure", attempt=2)
    assert point.attempts() == 2
    write(point, "attempt", attempt=3)
    assert point.attempts() == 3
    (point.folder / "record.json").unlink()
    assert point.attempts() == 3


def test_point_runs_as_long_as_its_holder_lives(point: Point) -> None:
    point.folder.mkdir(parents=True)
    assert not point.is_running()
    assert not (point.folder / ".lock").exists()  # to look writes nothing
    command = [sys.executable, "-c", HOLDER, str(point.folder / ".lock")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        assert point.is_running()
        holder.kill()
    deadline = time.monotonic() + 5
    while point.is_running() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert point.state() is State.MISSING


@pytest.mark.parametrize(
    "changes",
    [
        {"files": {"../trials.csv": "0" * 64}},
        {"files": {"/etc/hostname": "0" * 64}},
        {"files": {"trials.csv": "0"}},
        {"stages": {"..": "0" * 32}},
        {"stages": {"tasks": "../../x"}},
        {"git": {"diff": "../x"}},
        {"git": None},
        {"config": {**CONFIG, "dt": 0.25}},
    ],
)
def test_record_with_strange_names_or_another_config_does_not_count(
    changes: dict[str, Any], point: Point
) -> None:
    finish(point, **changes)
    assert point.record() is None
    assert "is no record of this point" in str(point.damage())


def test_point_whose_folder_is_a_link_is_nobodys(point: Point, tmp_path: Path) -> None:
    finish(point)
    point.folder.rename(tmp_path / "elsewhere")
    (tmp_path / "points" / point.identity).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match="is a link"):
        point.state()
