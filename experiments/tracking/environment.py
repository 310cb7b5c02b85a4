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

from experiments.config.paths import CHECKOUT
from experiments.tracking.files import digest, replace_file

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
# Untracked files above this size [bytes] are named in a record, and their content is not kept.
_LARGEST_KEPT = 200_000


def surroundings(results: Path) -> dict[str, Any]:
    """What a record says of the code and the machine.

    Args:
        results: the folder of all results; what the checkout has changed since its commit is kept
            in its `diffs`, once for all records.
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


def forget_peak_memory() -> None:
    """Start the peak of this process's memory anew, where the system allows it."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def peak_memory() -> int:
    """Peak of this process's memory [MB], since `forget_peak_memory` where that is possible."""
    try:
        status = Path("/proc/self/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) // 1024
    except (OSError, IndexError, ValueError):
        unit = 1024**2 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // unit


@cache
def _git_state() -> tuple[str | None, bytes, list[str]]:
    """Commit, all changes since as a diff, and untracked files; results count for neither.

    Looked up once, as this process's code does not change either.
    """
    head = _git("rev-parse", "HEAD")
    if head is None:
        return None, b"", []
    but_results = ("--", ".", ":(exclude)results")
    diff = _git("diff", "--binary", "HEAD", *but_results) or b""
    listed = _git("ls-files", "-z", "--others", "--exclude-standard", *but_results) or b""
    untracked = [os.fsdecode(name) for name in listed.split(b"\0") if name]
    for name in untracked:
        path = Path(CHECKOUT or "", name)
        if path.is_file() and path.stat().st_size <= _LARGEST_KEPT:
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
    found: dict[str, str | None] = {}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = None
    return found
