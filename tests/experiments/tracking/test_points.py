"""What a point is, what is known of it, and what its record says."""

import dataclasses
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tiny_point import composed, computed, hopeless, planned

from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.sweep import attempt
from experiments.tracking import environment
from experiments.tracking.points import Point, State

# Changing this makes every point of every study anew: only when what a point is has changed.
DEFAULT_POINT = "4eb828fd093491d20e0f080f71362122"
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


def test_state_follows_a_point(point: Point, settings: Settings) -> None:
    assert point.state() is State.MISSING
    assert not point.folder.exists()
    attempt.run_here(point, settings, print)
    assert point.state() is State.DONE
    record = point.folder / "record.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | {"source": "before an edit"}))
    assert point.state() is State.STALE
    attempt.run_here(point, settings, print)
    assert point.state() is State.DONE
    assert point.record()["source"] == point.source
    assert point.record()["attempt"] == 2
    wrong = planned(hopeless(settings), point.results)
    with pytest.raises(RuntimeError, match="no demonstration was kept") as caught:
        computed(hopeless(settings), point.results)
    assert wrong.state() is State.FAILED
    failure = wrong.failure()
    assert (failure["reason"], failure["attempt"]) == ("raised", 1)
    assert failure["error"] == f"RuntimeError: {caught.value}"
    assert "in run_point" in failure["traceback"]


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
    (point.folder / "attempt.json").write_text(json.dumps(note))
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
    assert record["config"]["grid"] == {"shape": [12, 8], "offset": None}
    assert record["summary"] == summary_row(point)
    assert record["summary"]["kept"] == 4
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


def test_peak_memory_is_that_of_the_point_alone() -> None:
    if not Path("/proc/self/clear_refs").exists():
        pytest.skip("this system does not forget peaks")
    big = np.ones(50_000_000)
    assert environment.peak_memory() > big.nbytes // 1024**2
    del big
    environment.reset_peak_memory()
    before = environment.peak_memory()
    big = np.ones(25_000_000)
    assert environment.peak_memory() - before == pytest.approx(big.nbytes / 1024**2, abs=20)


def test_changes_since_the_commit_are_kept_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkout, results = tmp_path / "checkout", tmp_path / "results"
    (checkout / "results").mkdir(parents=True)

    def git(*arguments: str) -> None:
        author = ["-c", "user.name=n", "-c", "user.email=e"]
        subprocess.run(["git", *author, *arguments], cwd=checkout, check=True, capture_output=True)

    def state() -> dict:
        environment._git_state.cache_clear()
        return environment.environment(results)["git"]

    monkeypatch.setattr(environment, "CHECKOUT", checkout)
    git("init")
    (checkout / "code.py").write_text("old\n")
    git("add", ".")
    git("commit", "-m", "first")
    (checkout / "results" / "table.csv").touch()
    clean = state()
    assert (clean["dirty"], clean["diff"], clean["untracked"]) == (False, None, [])
    assert len(clean["commit"]) == 40
    (checkout / "code.py").write_text("edited\n")
    (checkout / "new.py").write_text("added\n")
    (checkout / "large.bin").write_bytes(bytes(300_000))
    dirty = state()
    assert dirty["commit"] == clean["commit"]
    assert dirty["dirty"]
    assert dirty["untracked"] == ["large.bin", "new.py"]
    assert state() == dirty
    (kept,) = (results / "diffs").iterdir()
    assert kept.name == dirty["diff"]
    git("stash")
    (checkout / "new.py").unlink()
    git("apply", str(kept))
    assert (checkout / "code.py").read_text() == "edited\n"
    assert (checkout / "new.py").read_text() == "added\n"
    environment._git_state.cache_clear()
