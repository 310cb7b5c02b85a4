"""Sweeps here and in processes of their own, of points that take a fraction of a second."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest import mock

import commands

from experiments import run as run_command
from experiments.config.paths import CHECKOUT

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
    "demonstrations.pairs=6",
    "demonstrations.keep=2",
    "demonstrations.dt=0.1",
    "demonstrations.goal_tolerance=5",
    "demonstrations.iterations=1",
    "demonstrations.restarts=1",
    "ranks.demonstrations=1",
    "ranks.subsets=2",
    "inference.calibrate=false",
    "truth.boxes=[{lower:[-0.6,null],upper:[0.6,null]}]",
]
# A system that goes wrong in the worker only, once the config was accepted.
FAULTY = """
import os, resource, sys, time, warnings
from dataclasses import dataclass
from pathlib import Path
from mlci.systems import DoubleIntegrator

@dataclass(frozen=True, eq=False)
class Faulty(DoubleIntegrator):
    fault: str = "none"

    def dynamics(self, states, controls):
        accepted = len(states) > 100  # and not tried before any work
        fault = self.fault if accepted and not Path("healed").exists() else "none"
        if fault == "raise":
            raise ArithmeticError("the mass fell off its line")
        if fault == "exit":
            os._exit(3)
        if fault == "crash":
            os.abort()
        if fault == "hang":
            time.sleep(600)
        if fault == "slow":
            time.sleep(0.005)
        if fault == "warn":
            os.system("echo from another program")
            warnings.warn("the mass wobbles")
        # No file may grow beyond this: a full disk, for one point, once it is accepted.
        if accepted or self.fault != "full":
            most = 5_000 if fault == "full" else resource.RLIM_INFINITY
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))
        return super().dynamics(states, controls)
"""


def start(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*RUN, *TINY, f"results={folder / 'results'}", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{CHECKOUT}"},
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
    out, err = process.communicate(timeout=600)
    return process.returncode, out, err


def run_here(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """The same from this process, which need not import everything again; its workers do.

    There is one worker, unless the arguments say otherwise.
    """
    words = [*TINY, "workers=1", f"results={folder / 'results'}", *arguments]
    path = f"{folder}{os.pathsep}{CHECKOUT}"
    usual = signal.getsignal(signal.SIGTERM)
    with (
        mock.patch.dict(os.environ, PYTHONPATH=path),
        mock.patch.object(sys, "path", [str(folder), *sys.path]),
    ):
        try:
            done = commands.run_here(run_command.main, *words, folder=folder)
        finally:
            signal.signal(signal.SIGTERM, usual)
            for module in folder.glob("*.py"):  # another folder may have one of the same name
                sys.modules.pop(module.stem, None)
    return done.returncode, done.stdout, done.stderr


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
