"""Sweeps as a user runs them: parallel, resumed, failing and stopped."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from experiments.record import CHECKOUT

RUN = [sys.executable, str(CHECKOUT / "experiments" / "run.py")]
TINY = [
    "system=double_integrator",
    "truth=wall",
    "grid.shape=[8,8]",
    "hypotheses.shape=[5,null]",
    "horizon=4",
    "dt=0.5",
    "actions=3",
    "rollouts=1",
    "safety.shape=[11,11]",
    "demonstrations.pairs=4",
    "demonstrations.keep=2",
    "demonstrations.dt=0.1",
    "demonstrations.goal_tolerance=5",
    "demonstrations.iterations=1",
    "demonstrations.restarts=1",
    "ranks.demonstrations=1",
    "ranks.subsets=2",
    "truth.boxes=[{lower:[-0.6,null],upper:[0.6,null]}]",
]
# A system that goes wrong in the worker only, once the config was accepted.
FAULTY = """
import os, sys, time
from dataclasses import dataclass
from mlci.systems import DoubleIntegrator

@dataclass(frozen=True, eq=False)
class Faulty(DoubleIntegrator):
    fault: str = "none"

    def dynamics(self, states, controls):
        if self.fault == "raise":
            raise ArithmeticError("the mass fell off its line")
        if self.fault == "exit":
            os._exit(3)
        if self.fault == "hang":
            time.sleep(600)
        return super().dynamics(states, controls)
"""


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*RUN, *TINY, f"results={folder / 'results'}", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A shell starts background jobs, and so perhaps these tests, with SIGINT ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def run(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """Exit status, output and errors of a command."""
    process = start(folder, *arguments)
    out, err = process.communicate(timeout=120)
    return process.returncode, out, err


def running(group: int) -> list[str]:
    """Processes of a group that have not ended; one that ended may still wait to be noticed."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it ended between listing and reading
            name, _, rest = path.read_text().rpartition(") ")
            state, _, its_group = rest.split()[:3]
            if its_group == str(group) and state not in "ZX":
                found.append(name)
    return found


def gone(group: int, patience: float = 2.0) -> bool:
    """Whether no process of a group is left, within some seconds."""
    deadline = time.monotonic() + patience
    while running(group) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not running(group)


def tables(folder: Path, study: str) -> dict[str, bytes]:
    found = {path.name: path.read_bytes() for path in (folder / "results" / study).rglob("*.csv")}
    assert found
    return found


def faulty(folder: Path) -> list[str]:
    (folder / "faulty.py").write_text(FAULTY)
    return ["system._target_=faulty.Faulty"]


def test_tables_do_not_depend_on_workers_order_or_repetition(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    one.mkdir()
    two.mkdir()
    status, out, err = run(one, "-m", "dt=0.5,1.0", "actions=2,3", "study=s", "workers=2")
    assert status == 0, err
    assert "4 points: 0 done, 4 to run" in out
    status, out, err = run(two, "-m", "actions=3,2,3", "dt=1,0.5", "study=s", "workers=1")
    assert status == 0, err
    assert "2 of 6 combinations repeat others" in out
    assert "4 points: 0 done, 4 to run" in out
    assert tables(one, "s") == tables(two, "s")
    # Nothing but results was written, and nothing is run twice.
    assert [path.name for path in two.iterdir()] == ["results"]
    status, out, _ = run(two, "-m", "dt=0.5,1.0", "actions=2,3", "study=again")
    assert status == 0
    assert "4 points: 4 done, 0 to run" in out
    assert tables(one, "s") == tables(two, "again")


def test_single_run_shows_its_log_again_when_it_was_finished(tmp_path: Path) -> None:
    status, first, _ = run(tmp_path)
    assert status == 0
    assert "written: " in first
    status, second, _ = run(tmp_path, "study=another")
    assert status == 0
    assert second.splitlines()[:-1] == first.splitlines()[:-1]
    assert "finished before: " in second


def test_failed_points_leave_the_others_and_no_table(tmp_path: Path) -> None:
    wrong = faulty(tmp_path)
    status, out, err = run(tmp_path, "-m", *wrong, "+system.fault=raise,none,exit", "study=s")
    assert status == 1
    assert "3 points: 0 done, 3 to run" in out
    assert "2 of 3 points failed" in err
    assert "ArithmeticError: the mass fell off its line" in err
    assert "in dynamics" in err
    assert "+system.fault=exit: ProcessExpired" in err
    assert len(list((tmp_path / "results" / "points").glob("*/record.json"))) == 1
    assert not (tmp_path / "results" / "s").exists()


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_stopped_sweep_keeps_what_finished_and_leaves_no_process(
    stop: signal.Signals, tmp_path: Path
) -> None:
    wrong = faulty(tmp_path)
    process = start(tmp_path, "-m", *wrong, "+system.fault=none,hang", "workers=2")
    assert running(process.pid)
    points = tmp_path / "results" / "points"
    while not list(points.glob("*/record.json")) and process.poll() is None:
        time.sleep(0.1)
    if stop is signal.SIGINT:
        os.killpg(process.pid, stop)  # as a terminal does, workers included
    else:
        process.send_signal(stop)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "stopped; what has finished is kept" in err
    assert "Traceback" not in err
    assert gone(process.pid)
    status, out, _ = run(tmp_path, "-m", *wrong, "+system.fault=none")
    assert status == 0
    assert "1 points: 1 done, 0 to run" in out
