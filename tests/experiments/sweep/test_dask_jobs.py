"""The Dask launcher with a cluster of its own process; schedulers and tables: tests/stress."""

from pathlib import Path
from types import ModuleType

import pytest
from commands import run_here
from sweeps import TINY, faulty, run

from experiments import run as run_command
from experiments.sweep import dask_jobs, slurm

DASK = ["hydra/launcher=dask", "hydra.launcher.jobs=1"]


@pytest.mark.long
def test_a_dask_job_runs_its_share_and_tells_how_points_ended(tmp_path: Path) -> None:
    sweep = ["-m", *faulty(tmp_path), "+system.fault=none,exit", "study=s"]
    status, out, err = run(tmp_path, *sweep, *DASK)
    assert status == 1, out + err
    assert "1 Dask jobs" in out
    assert "1 of 2 points failed" in err
    assert err.count("ended with 3") == 1  # its own words, not those of its job


def test_scheduler_that_does_not_answer_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "0.5s")
    words = [
        "-m",
        *TINY,
        f"results={tmp_path}",
        *DASK,
        "hydra.launcher.scheduler=tcp://127.0.0.1:9",
    ]
    done = run_here(run_command.main, *words, folder=tmp_path)
    assert done.returncode == 2
    assert "hydra.launcher.scheduler: tcp://127.0.0.1:9 does not answer" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("engine", "module", "extra"),
    [("dask", dask_jobs, "distributed"), ("slurm", slurm, "submitit")],
)
def test_engine_without_its_extra_is_refused(
    engine: str, module: ModuleType, extra: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in an installation without the extras."""
    monkeypatch.setattr(module, "find_spec", lambda name: None if name == extra else module)
    words = ["-m", *TINY, f"results={tmp_path}", f"hydra/launcher={engine}"]
    done = run_here(run_command.main, *words, folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr == f"hydra/launcher: {engine} needs pip install 'mlci[{engine}]'\n"
    assert not list(tmp_path.iterdir())
