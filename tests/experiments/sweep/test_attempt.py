"""Attempts at a point: what they leave, whoever holds the lock and however they end."""

import dataclasses
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hand_made import alter
from tiny_point import computed, hopeless, planned

import experiments.point.run
from experiments.config.settings import Settings
from experiments.point.no_answer import NoAnswer
from experiments.sweep import attempt
from experiments.tracking.points import Point, State

COLUMNS = ["truth", "cells", "actions", "dt", "samples", "seed"]
HOLDER = """
import sys, time
from filelock import FileLock
with FileLock(sys.argv[1]):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def point(settings: Settings, tmp_path: Path) -> Point:
    return planned(settings, tmp_path)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Points that compute nothing: they do what they are given, and have a summary."""

    def use(action: Callable[[], object] = lambda: None) -> None:
        def run_point(*_: object) -> dict[str, pd.DataFrame]:
            action()
            return {"summary": pd.DataFrame([{"kept": 4, "error": np.inf}])}

        monkeypatch.setattr(experiments.point.run, "run_point", run_point)

    return use


def test_state_follows_a_point(point: Point, settings: Settings) -> None:
    assert point.state() is State.MISSING
    assert not point.folder.exists()
    attempt.run_here(point, settings, print)
    assert point.state() is State.DONE
    alter(point.folder / "record.json", source="before an edit")
    assert point.state() is State.STALE
    attempt.run_here(point, settings, print)
    assert point.state() is State.DONE
    assert point.record()["source"] == point.source
    assert point.record()["attempt"] == 2
    wrong = planned(hopeless(settings), point.results)
    with pytest.raises(NoAnswer, match="no demonstration was kept") as caught:
        computed(hopeless(settings), point.results)
    assert wrong.state() is State.FAILED
    failure = wrong.failure()
    assert (failure["reason"], failure["attempt"]) == ("raised", 1)
    assert (failure["error"], failure["traceback"]) == (str(caught.value), "")


def test_an_error_keeps_its_traceback(settings: Settings, tmp_path: Path) -> None:
    (tmp_path / "store").write_text("not a folder")
    point = planned(settings, tmp_path)
    with pytest.raises(OSError, match="store"):
        computed(settings, tmp_path)
    failure = point.failure()
    assert failure["reason"] == "raised"
    assert failure["error"].partition(":")[0] in ("FileExistsError", "NotADirectoryError")
    assert "in run_point" in failure["traceback"]
    assert (point.folder / "log.txt").read_text().startswith("Traceback")


def test_point_runs_as_long_as_its_holder_lives(point: Point, settings: Settings) -> None:
    point.folder.mkdir(parents=True)
    command = [sys.executable, "-c", HOLDER, str(point.folder / ".lock")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        assert point.state() is State.RUNNING
        assert attempt.run_in_worker(point, settings) is State.RUNNING
        holder.kill()
    deadline = time.monotonic() + 5
    while point.state() is State.RUNNING and time.monotonic() < deadline:
        time.sleep(0.01)
    assert point.state() is State.MISSING
    assert attempt.record_death(point, RuntimeError("killed"), 0)["reason"] == "died"
    assert point.state() is State.FAILED


def test_point_that_somebody_finished_is_not_run_again(point: Point, settings: Settings) -> None:
    attempt.run_here(point, settings, print)
    before = (point.folder / "record.json").read_bytes()
    assert attempt.run_in_worker(point, settings) is State.DONE
    assert (point.folder / "record.json").read_bytes() == before


def test_attempt_clears_what_a_killed_one_left(point: Point, settings: Settings) -> None:
    point.folder.mkdir(parents=True)
    (point.folder / ".trials.csv-abc.part").touch()
    note = {"identity": point.identity, "attempt": 4}
    point.write_note("attempt", note)
    attempt.run_here(point, settings, print)
    assert point.record()["attempt"] == 5
    assert {path.name for path in point.folder.iterdir()} == {
        *("trials.csv", "ranks.csv", "hypotheses.csv", "first.csv", "summary.csv"),
        *("sampled.csv", "violations.csv", "moves.csv", "probabilities.csv", "regions.csv"),
        *("attempts.csv", "paths.csv", "dimensions.csv", "log.txt", "record.json", ".lock"),
    }


def test_full_disk_is_a_failure_like_others(
    point: Point, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace = os.replace
    refused = []

    def refuse(source: str, target: Path) -> None:
        if target.parent == point.folder and target.name != "attempt.json":
            refused.append(target.name)
            raise OSError(28, "No space left on device", str(target))
        replace(source, target)

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OSError, match=r"No space left.*attempts.csv"):
        attempt.run_here(point, settings, print)
    assert point.state() is State.MISSING  # there was no room to say more
    assert refused == ["attempts.csv", "failure.json"]


def summary_row(point: Point) -> dict[str, float | None]:
    """What the point's own table holds, with None where it has no number."""
    table = pd.read_csv(point.folder / "summary.csv")
    (row,) = table.drop(columns=COLUMNS).to_dict("records")
    return {name: None if np.isnan(value) else value for name, value in row.items()}


def test_record_says_what_a_result_comes_from(point: Point, settings: Settings) -> None:
    attempt.run_here(point, settings, print)
    record = point.record()
    assert record["config"]["grid"] == {"shape": [12, 8], "offset": None, "refined": 0}
    assert record["summary"] == summary_row(point)
    assert record["summary"]["kept"] == 5
    assert record["summary"]["final_state_error"] > 0
    wanted = {"identity", "source", "seed", "files", "stages", "attempt", "started", "seconds"}
    wanted |= {"git", "host", "system", "cpu", "cores", "blas_threads", "python", "packages"}
    assert wanted <= set(record)
    assert record["packages"]["numpy"] == np.__version__
    assert record["blas_threads"] == "1"
    assert 10 < record["peak_memory_mb"] < 10_000


def test_record_has_null_where_a_summary_has_no_number(settings: Settings, tmp_path: Path) -> None:
    # In so short a step no action leaves its cell, and no goal can be reached.
    still = computed(dataclasses.replace(settings, dt=0.05), tmp_path)
    record = still.record()
    assert record["summary"] == summary_row(still)
    assert record["summary"]["feasible"] == 0
    assert record["summary"]["final_state_error"] is None


def test_table_is_written_before_the_record_that_makes_it_count(
    point: Point, settings: Settings, quick: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    quick()
    written: list[str] = []
    replace = os.replace

    def watch(source: str, target: Path) -> None:
        written.append(Path(target).name)
        replace(source, target)

    monkeypatch.setattr(os, "replace", watch)
    attempt.run_here(point, settings, print)
    assert [name for name in written if not name.endswith(".diff")] == [
        *("attempt.json", "summary.csv", "record.json")
    ]
    assert point.record()["summary"] == {"kept": 4, "error": None}
    assert not (point.folder / "attempt.json").exists()


def test_old_record_is_gone_before_a_new_attempt_computes(
    point: Point, settings: Settings, quick: Callable[..., None]
) -> None:
    quick()
    attempt.run_here(point, settings, print)
    seen = []
    quick(lambda: seen.append((point.record(), point.is_running(), point.note("attempt"))))
    attempt.run_here(point, settings, print, force=True)
    ((before, running, note),) = seen
    assert before is None
    assert running
    assert (note["attempt"], note["pid"]) == (2, os.getpid())


def test_worker_runs_a_finished_point_again_only_if_forced(
    point: Point, settings: Settings, quick: Callable[..., None]
) -> None:
    quick()
    for force, attempts in ((False, 1), (False, 1), (True, 2)):
        assert attempt.run_in_worker(point, settings, force=force) is State.DONE
        assert point.attempts() == attempts


def test_worker_has_its_time_limit(
    point: Point, settings: Settings, quick: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    quick()
    limits: list[float | None] = []

    def crash_trace(_: Point, time_limit: float | None) -> nullcontext[None]:
        limits.append(time_limit)
        return nullcontext()

    monkeypatch.setattr(attempt, "crash_trace", crash_trace)
    attempt.run_in_worker(point, settings, time_limit=7.0)
    assert limits == [7.0]


def test_lock_is_free_after_a_failure(
    point: Point, settings: Settings, quick: Callable[..., None]
) -> None:
    def fail() -> None:
        raise ArithmeticError("the mass fell\noff its line")

    quick(fail)
    for _ in range(2):
        with pytest.raises(ArithmeticError):
            attempt.run_in_worker(point, settings)
        assert not point.is_running()
    failure = point.failure()
    assert (failure["attempt"], failure["reason"]) == (2, "raised")
    assert failure["error"] == "ArithmeticError: the mass fell off its line"
    assert failure["seconds"] >= 0
    assert "in fail" in (point.folder / "log.txt").read_text()
    assert sorted(path.name for path in point.folder.iterdir()) == [
        *(".lock", "failure.json", "log.txt")
    ]


def test_output_of_a_worker_goes_to_the_log_of_its_point(
    point: Point, settings: Settings, quick: Callable[..., None], capfd: pytest.CaptureFixture[str]
) -> None:
    quick(lambda: os.system("echo from another program"))
    attempt.run_in_worker(point, settings)
    print("after it")
    assert capfd.readouterr().out == "after it\n"
    assert (point.folder / "log.txt").read_text() == "from another program\n"


def test_death_is_recorded_once_and_only_of_a_later_attempt(point: Point) -> None:
    point.folder.mkdir(parents=True)
    killed = ChildProcessError("the worker process was killed by SIGKILL")
    # The first attempt did not get as far as to start.
    assert attempt.record_death(point, killed, 0)["attempt"] == 1
    first = (point.folder / "failure.json").read_bytes()
    assert attempt.record_death(point, RuntimeError("another"), 0)["error"] == (
        "ChildProcessError: the worker process was killed by SIGKILL"
    )
    assert (point.folder / "failure.json").read_bytes() == first
    point.write_note("attempt", {"identity": point.identity, "attempt": 2})
    assert attempt.record_death(point, RuntimeError("another"), 1)["attempt"] == 2
    assert not (point.folder / "attempt.json").exists()


def test_death_says_where_its_own_attempt_was(point: Point) -> None:
    point.folder.mkdir(parents=True)
    trace = point.folder / "crash_trace.txt"
    text = "Timeout (0:00:02)!\nThread 1:\n  File x in inner\n  File y in run_in_worker\n"
    point.write_note("attempt", {"identity": point.identity, "attempt": 1})
    trace.write_text(text)
    failure = attempt.record_death(point, ChildProcessError("ended with 1"), 0)
    assert (failure["reason"], failure["error"]) == ("timeout", "still running at its time limit")
    assert failure["traceback"] == "Timeout (0:00:02)!\n  File x in inner"
    trace.write_text(text)  # of the attempt before: the next one did not get as far as to start
    failure = attempt.record_death(point, ChildProcessError("ended with 1"), 1)
    assert (failure["reason"], failure["traceback"]) == ("died", "")


def test_death_of_a_point_that_another_process_runs_is_not_recorded(point: Point) -> None:
    point.folder.mkdir(parents=True)
    with point.lock:
        failure = attempt.record_death(point, RuntimeError("killed"), 0)
    assert failure == {"reason": "died", "error": "RuntimeError: killed", "traceback": ""}
    assert point.failure() is None


def test_death_after_the_record_is_no_failure(
    point: Point, settings: Settings, quick: Callable[..., None]
) -> None:
    quick()
    attempt.run_here(point, settings, print)
    attempt.record_death(point, RuntimeError("killed"), 0)
    assert point.state() is State.DONE
    assert point.failure() is None
