"""The Dask launcher with a cluster of its own process; schedulers and tables: tests/stress."""

import os
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
    assert done.stderr == f"hydra/launcher: {engine} needs {extra}: pip install {extra}\n"
    assert not list(tmp_path.iterdir())


def test_a_cluster_in_this_process_is_reached_from_this_machine_alone() -> None:
    before = listening()
    client = dask_jobs.DaskLauncher(1, None, 1, fail_fast=False)._client()
    try:
        opened = listening() - before
        assert client.submit(sum, [1, 2]).result(timeout=600) == 3
        assert {address for address, _ in opened} <= {"0100007F"}
    finally:
        client.close()


def listening() -> set[tuple[str, str]]:
    """Address and port, in hexadecimal, at which this process listens."""
    mine = {os.readlink(link) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()}
    rows = [
        line.split()
        for version in ("tcp", "tcp6")
        for line in Path(f"/proc/self/net/{version}").read_text().splitlines()[1:]
    ]
    listed = [row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in mine]
    return {tuple(place.split(":")) for place in listed}


def test_tls_needs_all_its_files(tmp_path: Path) -> None:
    words = ["-m", *TINY, f"results={tmp_path}", *DASK, "hydra.launcher.tls={ca_file: x}"]
    done = run_here(run_command.main, *words, folder=tmp_path)
    assert (done.returncode, done.stderr) == (
        2,
        "hydra.launcher.tls: give it ca_file, cert, key, each a file\n",
    )
