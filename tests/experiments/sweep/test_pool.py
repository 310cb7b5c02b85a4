"""Worker processes, each of which can fail alone."""

import sys
from pathlib import Path
from typing import Any

import pytest
from hydra.core.utils import JobReturn, JobStatus

from experiments.sweep import pool
from experiments.sweep.pool import PoolLauncher

TASKS = """
import os, signal

def task(config):
    if config.end == "raise":
        raise ArithmeticError("the mass fell")
    if config.end == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if config.end == "stop":
        os.kill(os.getpid(), signal.SIGSTOP)
    return config.end
"""


@pytest.fixture
def task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A task that ends as its config says; a worker imports it by name."""
    (tmp_path / "tasks_of_pool.py").write_text(TASKS)
    monkeypatch.syspath_prepend(tmp_path)
    import tasks_of_pool

    yield tasks_of_pool.task
    del sys.modules["tasks_of_pool"]


def launch(task: Any, ends: list[str], *, workers: int, fail_fast: bool) -> list[JobReturn]:
    launcher = PoolLauncher(workers, fail_fast)
    jobs = [(f"end={end}",) for end in ends]
    launcher.task = task
    limits = {"sweep": {"time_limit": 1.0}}
    launcher.composed = {job: {"end": end, **limits} for job, end in zip(jobs, ends, strict=True)}
    launcher.names = {jobs[0]: "the first"}
    return list(launcher.launch(jobs, 0))


def test_each_job_returns_its_own_end(task: Any, capsys: pytest.CaptureFixture[str]) -> None:
    ends = ["raise", "kill", "well"]
    returns = launch(task, ends, workers=1, fail_fast=False)
    assert [each.overrides for each in returns] == [[f"end={end}"] for end in ends]
    assert [each.status for each in returns] == [
        *(JobStatus.FAILED, JobStatus.FAILED, JobStatus.COMPLETED)
    ]
    assert returns[2].return_value == "well"
    assert [str(each._return_value) for each in returns[:2]] == [
        *("the mass fell", "the worker process was killed by SIGKILL")
    ]
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(" ")[0] for line in lines] == ["[1/3]", "[2/3]", "[3/3]"]
    assert any(line.endswith("] the first: FAILED") for line in lines)
    assert any("] end=well: well, " in line for line in lines)


def test_no_job_starts_after_a_failure_that_stops_the_sweep(task: Any) -> None:
    returns = launch(task, ["raise", "well"], workers=1, fail_fast=True)
    assert [each.status for each in returns] == [JobStatus.FAILED, JobStatus.UNKNOWN]


def test_a_worker_that_was_stopped_is_killed_after_its_time_limit(
    task: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It cannot end itself then, and its point would keep the sweep waiting for ever."""
    monkeypatch.setattr(pool, "_GRACE", 2.0)
    stopped, well = launch(task, ["stop", "well"], workers=1, fail_fast=False)
    assert (stopped.status, well.status) == (JobStatus.FAILED, JobStatus.COMPLETED)
    assert isinstance(stopped._return_value, TimeoutError)
