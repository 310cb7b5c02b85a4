"""The Dask launcher with a cluster of its own process; schedulers and workers: tests/stress."""

from pathlib import Path

import pytest
from sweeps import faulty, run, tables

DASK = ["hydra/launcher=dask", "hydra.launcher.jobs=2"]
# An installation without the extras.
WITHOUT = """
from importlib.machinery import PathFinder

find = PathFinder.find_spec
PathFinder.find_spec = classmethod(
    lambda cls, name, *rest: None if name in ("distributed", "submitit") else find(name, *rest)
)
"""


def test_dask_gives_the_tables_of_worker_processes(tmp_path: Path) -> None:
    sweep = ["-m", *faulty(tmp_path), "+system.fault=none,exit", "dt=0.5,1.0", "study=s"]
    status, out, err = run(tmp_path, *sweep, *DASK, "workers=2")
    assert status == 1, out + err
    assert "2 Dask jobs" in out
    assert "2 of 4 points failed" in err
    assert err.count("ended with 3") == 2  # its own words, not those of its job
    (tmp_path / "healed").touch()
    status, out, err = run(tmp_path, *sweep, *DASK)
    assert status == 0, out + err
    assert "4 points: 2 done, 2 failed; 2 to run" in out
    status, out, err = run(tmp_path, *sweep, f"results={tmp_path / 'local' / 'results'}")
    assert status == 0, out + err
    assert tables(tmp_path, "s") == tables(tmp_path / "local", "s")


def test_scheduler_that_does_not_answer_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "0.5s")
    status, _, err = run(tmp_path, "-m", *DASK, "hydra.launcher.scheduler=tcp://127.0.0.1:9")
    assert status == 2
    assert "hydra.launcher.scheduler: tcp://127.0.0.1:9 does not answer" in err
    assert "Traceback" not in err


@pytest.mark.parametrize("engine", ["dask", "slurm"])
def test_engine_without_its_extra_is_refused(engine: str, tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(WITHOUT)
    status, _, err = run(tmp_path, "-m", f"hydra/launcher={engine}")
    assert status == 2
    assert err == f"hydra/launcher: {engine} needs pip install 'mlci[{engine}]'\n"
