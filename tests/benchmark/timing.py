"""How the benchmark measures: processor time of one thread, and rates of this machine."""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["JAX_PLATFORMS"] = "cpu"

import platform
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import scipy

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Row:
    """One thing that was timed.

    Attributes:
        name: what tables and the README call it.
        median_s: median processor time of the runs [s].
        floor_s: what no implementation in numpy could beat by much: a measured rate of this
            machine times the bytes or calls that it cannot do without; NaN where there is none.
        runs: number of runs, after one that does not count.
        what: in words, with what its floor is.
        paper: what the paper says of it.
    """

    name: str
    median_s: float
    floor_s: float
    runs: int
    what: str
    paper: str = ""


@dataclass(frozen=True)
class Cost:
    """One thing that was counted: its name, value and unit, and what it is in words."""

    name: str
    value: float
    unit: str
    what: str


def median_seconds(work: Callable[[], object], runs: int = 7) -> float:
    """Median processor time of a call, after one that does not count."""
    work()
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return float(np.median(times))


def copy_rate(size: int) -> float:
    """Bytes per second of a copy, read and written bytes counted, of an array of `size` bytes."""
    source = np.ones(size // 8)
    target = np.empty_like(source)
    repeats = max(1, (1 << 26) // size)
    seconds = median_seconds(lambda: [np.copyto(target, source) for _ in range(repeats)])
    return 2 * size * repeats / seconds


def exp_seconds(count: int) -> float:
    """Seconds of so many exponentials, at the rate of an array that stays in the cache."""
    values = np.full(1 << 12, -1.0)
    repeats = 16
    seconds = median_seconds(lambda: [np.exp(values) for _ in range(repeats)])
    return seconds * count / (repeats * values.size)


def machine() -> dict[str, str | int]:
    """The columns that say where and with what a number was measured."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    git = ["git", "-C", str(ROOT), "describe", "--always", "--dirty", "--abbrev=12"]
    return {
        "cpu": names[0] if names else platform.processor(),
        "cores": os.cpu_count() or 1,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "commit": subprocess.run(git, capture_output=True, text=True).stdout.strip(),
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
    }
