"""The code, the packages and the machine that a result comes from."""

from __future__ import annotations

import os
import platform
import resource
import socket
import subprocess
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from experiments.tracking.files import digest, replace_file

_ROOT = Path(__file__).resolve().parents[2]
# The folder of the project's source tree; None for an installed wheel.
CHECKOUT = _ROOT if (_ROOT / "pyproject.toml").is_file() else None

_PACKAGES = (
    "mlci",
    "numpy",
    "scipy",
    "pandas",
    "hydra-core",
    "omegaconf",
    "filelock",
    "pebble",
)
# Untracked files above this size [bytes] are named in a record, but not part of its diff.
_LARGEST_IN_DIFF = 200_000


def environment(results: Path) -> dict[str, Any]:
    """What a record says about the code, the packages and the machine.

    Args:
        results: the folder of all results; the checkout's changes since its commit are written to
            its `diffs`, once for all records.
    """
    commit, diff, untracked = _git_state()
    name = None
    if diff:
        name = f"{digest(diff)[:32]}.diff"
        if not (results / "diffs" / name).exists():
            replace_file(results / "diffs" / name, diff)
    dirty = None if commit is None else bool(diff or untracked)
    return {
        "git": {"commit": commit, "dirty": dirty, "diff": name, "untracked": untracked},
        "host": socket.gethostname(),
        "system": platform.platform(),
        "cpu": _processor(),
        "cores": os.cpu_count(),
        "blas_threads": os.environ.get("OMP_NUM_THREADS"),
        "python": sys.version.split()[0],
        "packages": _versions(),
    }


def commit_words() -> str:
    """The checkout's commit, and whether files differ from it, in brackets; empty without one."""
    commit, diff, untracked = _git_state()
    changed = ", with changes" if diff or untracked else ""
    return "" if commit is None else f" (commit {commit[:12]}{changed})"


def reset_peak_memory() -> None:
    """Measure this process's peak memory from now on, where the system allows it."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def peak_memory() -> int:
    """Peak of this process's memory [MB], since `reset_peak_memory` where that is possible."""
    try:
        status = Path("/proc/self/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) // 1024
    except (OSError, IndexError, ValueError):
        unit = 1024**2 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // unit


@cache
def _git_state() -> tuple[str | None, bytes, list[str]]:
    """Commit, all changes since then as a diff, and untracked files; `results` is left out.

    Looked up once: this process's code does not change later.
    """
    head = _git("rev-parse", "HEAD")
    if head is None:
        return None, b"", []
    without_results = ("--", ".", ":(exclude)results")
    diff = _git("diff", "--binary", "HEAD", *without_results) or b""
    names = _git("ls-files", "-z", "--others", "--exclude-standard", *without_results) or b""
    untracked = [os.fsdecode(name) for name in names.split(b"\0") if name]
    for name in untracked:
        path = Path(CHECKOUT or "", name)
        if path.is_file() and path.stat().st_size <= _LARGEST_IN_DIFF:
            diff += _git("diff", "--binary", "--no-index", "--", "/dev/null", name) or b""
    return head.decode().strip(), diff, untracked


def _git(*arguments: str) -> bytes | None:
    """Output of a git command in the checkout, or None where there is no git or no commit."""
    if CHECKOUT is None:  # a repository around an installed wheel is somebody else's
        return None
    command = ["git", "--no-optional-locks", *arguments]
    try:
        done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, timeout=30)
    except (OSError, subprocess.TimeoutExpired):
        return None
    # A comparison of two files ends with 1 if they differ.
    return done.stdout if done.returncode in (0, int("--no-index" in arguments)) else None


@cache
def _processor() -> str:
    """Model of the CPU."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


@cache
def _versions() -> dict[str, str | None]:
    """Versions of the packages that the result may depend on."""
    versions: dict[str, str | None] = {}
    for package in _PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = None
    return versions
