"""Sweeps as a user runs them: parallel, resumed, failing and stopped.

Two at once, and many that are killed: `tests/stress/storm.py`.
"""

import json
import os
import re
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn
from unittest import mock

import pytest
from sweeps import faulty, gone, run_here, running, start, tables

from experiments.app import REFUSED
from experiments.config.read import ConfigError
from experiments.sweep.planner import Planner
from experiments.terminal import job_names
from experiments.tracking.points import Point
from experiments.tracking.study import write_plan


def test_tables_do_not_depend_on_workers_order_or_repetition(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    one.mkdir()
    two.mkdir()
    status, out, err = run_here(one, "-m", "dt=1.0", "actions=2,3", "study=s", "workers=2")
    assert status == 0, err
    assert "2 points: 2 missing; 2 to run" in out
    status, out, err = run_here(two, "-m", "actions=3,2,3", "dt=1", "study=s")
    assert status == 0, err
    assert "1 of 3 combinations repeat others" in out
    assert "2 points: 2 missing; 2 to run" in out
    assert tables(one, "s") == tables(two, "s")
    # Nothing but results was written, and nothing is run twice.
    assert [path.name for path in two.iterdir()] == ["results"]
    status, out, _ = run_here(two, "-m", "dt=1.0", "actions=2,3", "study=again")
    assert status == 0
    assert "2 points: 2 done; 0 to run" in out
    assert tables(one, "s") == tables(two, "again")


def test_tables_are_written_again_only_if_they_would_change(tmp_path: Path) -> None:
    def sweep(case: str) -> str:
        status, out, err = run_here(tmp_path, "-m", f"case='{case}'", "study=s")
        assert status == 0, err
        return out

    def case() -> str:
        return tables(tmp_path, "s")["cases.csv"].decode()

    folder = tmp_path / "results" / "s"
    assert f" tables in {folder / 'tables'}\n" in sweep("kind: one")
    assert (folder / "tables" / "cases.csv").is_file()
    before = tables(tmp_path, "s")
    assert f"up to date: {folder / 'tables'}\n" in sweep("kind: one")
    assert tables(tmp_path, "s") == before
    # A sweep that is stopped once it has written its plan.
    (identity,) = (folder.parent / "points").iterdir()
    write_plan(folder, [(Point(folder.parent, identity.name), ["case='kind: two'"])])
    assert "kind: one" in case()
    assert "written: " in sweep("kind: two")
    assert "kind: two" in case()


def test_single_run_shows_its_log_again_when_it_was_finished(tmp_path: Path) -> None:
    status, first, _ = run_here(tmp_path)
    assert status == 0
    assert "written: " in first
    status, second, _ = run_here(tmp_path, "study=another")
    assert status == 0
    assert second.splitlines()[:-1] == first.splitlines()[:-1]
    assert "finished before: " in second


def failure_table(err: str) -> list[list[str]]:
    """Reason, point and message of each row at the end."""
    rows = err[err.index("failed, and no table is written") :].splitlines()[1:]
    return [row.split(maxsplit=2) for row in rows]


def records(folder: Path) -> list[dict]:
    paths = (folder / "results" / "points").glob("*/record.json")
    return [json.loads(path.read_bytes()) for path in paths]


@pytest.mark.long
def test_failed_points_fail_alone_and_are_run_again_when_asked(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    sweep = ["-m", *faulty(tmp_path), "+system.fault=raise,none,crash,full,warn", "study=s"]
    status, out, err = run_here(tmp_path, *sweep)
    assert status == 1
    assert "5 points: 5 missing; 5 to run" in out
    assert "3 of 5 points failed" in err
    table = failure_table(err)
    name = "+system.fault="
    assert [row[:2] for row in table] == [
        ["raised", f"{name}raise"],
        ["died", f"{name}crash"],
        ["raised", f"{name}full"],
    ]
    assert table[0][2] == "ArithmeticError: the mass fell off its line"
    assert table[1][2] == "ChildProcessError: the worker process was killed by SIGABRT"
    assert table[2][2] == "OSError: [Errno 27] File too large"
    # Where each of them was, whether it could still say so itself or not.
    for where in ('raise ArithmeticError("the mass', "Fatal Python error: Abort"):
        assert where in err
    assert len(re.findall(r"in dynamics", err)) == 2
    assert not list((tmp_path / "results").rglob("*.part"))
    assert not list((tmp_path / "results" / "s").rglob("*.csv"))
    logs = [path.read_text() for path in (tmp_path / "results" / "points").glob("*/log.txt")]
    assert sum("from another program" in log and "the mass wobbles" in log for log in logs) == 1
    assert "wobbles" not in "".join([out, err, *capfd.readouterr()])

    status, out, err = run_here(tmp_path, *sweep, "sweep.only=[missing,stale]")
    assert status == 0
    assert "5 points: 2 done, 3 failed; 0 to run" in out
    assert "3 of 5 points left, and no table is written" in out
    (tmp_path / "healed").touch()
    status, out, err = run_here(tmp_path, *sweep)
    assert status == 0, err
    assert "5 points: 2 done, 3 failed; 3 to run" in out
    assert sorted(record["attempt"] for record in records(tmp_path)) == [1, 1, 2, 2, 2]
    assert not list((tmp_path / "results").rglob("failure.json"))


def test_point_that_hangs_is_ended_at_its_time_limit(tmp_path: Path) -> None:
    words = ["-m", *faulty(tmp_path), "+system.fault=hang", "sweep.time_limit=12"]
    status, _, err = run_here(tmp_path, *words)
    assert status == 1
    (row,) = failure_table(err)
    assert row[0] == "timeout"
    assert row[2].endswith("  still running at its time limit")
    assert "Timeout (0:00:12)" in err
    assert len(re.findall(r"in dynamics", err)) == 1


@pytest.mark.long
def test_first_failure_stops_a_sweep_that_fails_fast(tmp_path: Path) -> None:
    sweep = ["-m", *faulty(tmp_path), "+system.fault=raise,none", "seed=0,1,2"]
    status, out, err = run_here(tmp_path, *sweep, "sweep.fail_fast=true")
    assert status == 1
    assert "1 of 6 points failed" in err
    assert err.splitlines()[-1] == "not started: 5 points"
    status, out, err = run_here(tmp_path, *sweep, "sweep.limit=1")
    assert status == 1
    assert "6 points: 1 failed, 5 missing; 1 to run" in out
    failure = next((tmp_path / "results" / "points").glob("*/failure.json"))
    assert json.loads(failure.read_bytes())["attempt"] == 2


def test_dry_run_shows_states_and_writes_nothing(tmp_path: Path) -> None:
    status, out, err = run_here(tmp_path, "-m", "dt=0.5,1.0", "sweep.dry_run=true", "sweep.limit=1")
    assert status == 0, err
    header, first, second = out.splitlines()
    assert header == "2 points: 2 missing; 1 to run"
    assert re.fullmatch(r"run missing +[0-9a-f]{8}  dt=0.5", first)
    assert re.fullmatch(r"    missing +[0-9a-f]{8}  dt=1.0", second)
    assert not list(tmp_path.iterdir())


def listed(folder: Path, *arguments: str) -> list[str]:
    """The names of the points of a sweep, none of which is composed."""
    names: list[str] = []

    def plan(_: Planner, jobs: Sequence[Sequence[str]]) -> NoReturn:
        names.extend(job_names(jobs))
        raise ConfigError("named")

    with mock.patch.object(Planner, "_plan", plan):
        assert run_here(folder, "-m", *arguments) == (REFUSED, "", "named\n")
    return names


def test_each_of_the_settings_joins_each_combination(tmp_path: Path) -> None:
    settings = "hydra.sweeper.settings=[[],['temperature=2'],['safety.width=0.1','seed=3']]"
    ends = ["", " temperature=2", " safety.width=0.1 seed=3"]
    assert listed(tmp_path, settings) == ["defaults", *(end.strip() for end in ends[1:])]
    swept = [f"dt={dt}{end}" for dt in (0.5, 1.0) for end in ends]
    assert listed(tmp_path, "dt=0.5,1.0", settings) == swept
    assert listed(tmp_path, "dt=0.5,1.0", settings.replace("seed=3", "seed=3,4")) == [
        name for name in swept for name in ([name, name[:-1] + "4"] if "seed" in name else [name])
    ]
    # The command line wins, over one key of them as over a swept one.
    names = [f"seed={seed}{end.removesuffix(' seed=3')}" for seed in (4, 5) for end in ends]
    assert listed(tmp_path, settings, "seed=4,5") == names


def test_settings_of_an_experiment_stay_whole_at_smoke_scale(tmp_path: Path) -> None:
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "mine.yaml").write_text(
        """# @package _global_
study: mine
hydra:
  mode: MULTIRUN
  sweeper:
    params:
      temperature: 1,2,3
    settings:
      - []
      - [seed=1]
      - [grid=100, "tasks.lower=[null,-0.5]"]
      - ["seed=2,3,4", "case='some seeds: a few'"]
"""
    )
    words = ["experiment=mine", f"--config-dir={tmp_path}"]
    lists = ["", " seed=1", " grid=100 tasks.lower=[null,-0.5]"]
    for scale, values, seeds in (([], (1, 2, 3), (2, 3, 4)), (["scale=smoke"], (1, 3), (2,))):
        found = listed(tmp_path, *scale, *words)
        every = [*lists, *(f" seed={seed} case=some seeds: a few" for seed in seeds)]
        assert found == [f"temperature={value}{case}" for value in values for case in every]


def test_forced_point_runs_again(tmp_path: Path) -> None:
    assert run_here(tmp_path)[0] == 0
    before = tables(tmp_path, "points")
    status, out, _ = run_here(tmp_path, "-m", "study=s", "sweep.force=true")
    assert status == 0
    assert "1 point: 1 done; 1 to run" in out
    assert [record["attempt"] for record in records(tmp_path)] == [2]
    assert tables(tmp_path, "points") == before


@pytest.mark.parametrize(
    "stop", [signal.SIGINT, pytest.param(signal.SIGHUP, marks=pytest.mark.long)]
)
def test_stopped_sweep_keeps_what_finished_and_leaves_no_process(
    stop: signal.Signals, tmp_path: Path
) -> None:
    """By Ctrl-C, or as its terminal goes; SIGTERM and SIGKILL are for the storms."""
    wrong = faulty(tmp_path)
    process = start(tmp_path, "-m", *wrong, "+system.fault=none,hang", "workers=2")
    assert running(process.pid)
    points = tmp_path / "results" / "points"
    while not list(points.glob("*/record.json")) and process.poll() is None:
        time.sleep(0.1)
    os.killpg(process.pid, stop)  # as a terminal does, workers included
    _, err = process.communicate(timeout=600)
    assert process.returncode == 130
    assert "stopped; what has finished is kept" in err
    assert "Traceback" not in err
    assert gone(process.pid)
    status, out, _ = run_here(tmp_path, "-m", *wrong, "+system.fault=none")
    assert status == 0
    assert "1 point: 1 done; 0 to run" in out
