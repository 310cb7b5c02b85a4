"""The code, the packages and the machine that a result comes from."""

from __future__ import annotations

import os
import platform
import resource
import socket
import stat
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
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
    "numba",
    "pandas",
    "hydra-core",
    "omegaconf",
    "filelock",
    "pebble",
)
# Untracked files above this size [bytes] are named in a record, but not part of its diff.
_LARGEST_IN_DIFF = 200_000
# Untracked files of other kinds may be anything, such as keys.
_OWN_KINDS = (".py", ".yaml", ".toml")
# A diff that `git apply` takes, whatever the user has set.
_PLAIN_DIFF = (
    *("--binary", "--no-ext-diff", "--no-textconv", "--no-color", "--no-renames"),
    *("--no-relative", "--src-prefix=a/", "--dst-prefix=b/", "-U3"),
)


def environment(results: Path) -> dict[str, Any]:
    """What a record says about the code, the packages and the machine.

    Args:
        results: the folder of all results; the checkout's changes since its commit are written to
            its `diffs`, once for all records.
    """
    code, name = _git_state(), None
    if code.diff:
        name = f"{digest(code.diff)[:32]}.diff"
        if not (results / "diffs" / name).exists():
            replace_file(results / "diffs" / name, code.diff, code.readers)
    return {
        "git": {
            "commit": code.commit,
            "reason": code.reason,
            "dirty": None if code.commit is None else bool(code.diff or code.untracked),
            "diff": name,
            "untracked": list(code.untracked),
        },
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
    code = _git_state()
    changed = ", with changes" if code.diff or code.untracked else ""
    return "" if code.commit is None else f" (commit {code.commit[:12]}{changed})"


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


@dataclass(frozen=True)
class _Code:
    """The checkout's commit and what differs from it; `results` is left out.

    Attributes:
        commit: None where it is not known, for a `reason`.
        reason: why it is not.
        diff: all changes, with the untracked files that are the project's own and nobody's secret.
        untracked: names of all untracked files.
        readers: bits of the mode that all files in the diff have.
    """

    commit: str | None
    reason: str | None = None
    diff: bytes = b""
    untracked: tuple[str, ...] = ()
    readers: int = 0o666


class _NoAnswer(Exception):
    """Git does not tell; the message says why."""


@cache
def _git_state() -> _Code:
    """Looked up once: this process's code does not change later."""
    try:
        commit = _git("rev-parse", "--verify", "HEAD").decode().strip()
        without_results = ("--", ".", ":(exclude)results")
        diff = _git("diff", *_PLAIN_DIFF, "HEAD", *without_results)
        changed = _names(_git("diff", *_PLAIN_DIFF, "--name-only", "-z", "HEAD", *without_results))
        names = _git("ls-files", "-z", "--others", "--exclude-standard", *without_results)
        untracked = _names(names)
        added = [name for name in untracked if _is_own(Path(CHECKOUT or "", name))]
        for name in added:
            diff += _git("diff", *_PLAIN_DIFF, "--no-index", "--", "/dev/null", name)
    except _NoAnswer as error:
        return _Code(None, str(error))
    readers = 0o666
    for name in (*changed, *added):
        with suppress(OSError):  # it was removed
            readers &= Path(CHECKOUT or "", name).lstat().st_mode
    return _Code(commit, None, diff, untracked, readers)


def _names(listed: bytes) -> tuple[str, ...]:
    """Names that git lists, each ended by a zero."""
    return tuple(os.fsdecode(name) for name in listed.split(b"\0") if name)


def _is_own(path: Path) -> bool:
    """Whether an untracked file is part of the code: of its kinds, small, and no secret."""
    try:
        status = path.lstat()
    except OSError:
        return False
    everybody = stat.S_IRGRP | stat.S_IROTH
    return (
        stat.S_ISREG(status.st_mode)
        and path.suffix in _OWN_KINDS
        and not path.name.startswith(".")
        and bool(status.st_mode & everybody)
        and status.st_size <= _LARGEST_IN_DIFF
    )


def _git(*arguments: str) -> bytes:
    """Output of a git command in the checkout, whatever the user's settings.

    Raises:
        _NoAnswer: there is no git, no commit, or it refuses.
    """
    if CHECKOUT is None:  # a repository around an installed wheel is somebody else's
        raise _NoAnswer("the code is an installed package, not a checkout")
    command = ["git", "--no-optional-locks", "-c", "core.fsmonitor=false", *arguments]
    # Such as GIT_DIR or GIT_INDEX_FILE, which a hook that starts a sweep has of its own repository.
    clean = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    clean |= {"LC_ALL": "C", "GIT_CEILING_DIRECTORIES": str(CHECKOUT.parent)}
    try:
        done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, timeout=30, env=clean)
    except FileNotFoundError:
        raise _NoAnswer("git is not installed") from None
    except (OSError, subprocess.TimeoutExpired) as error:
        raise _NoAnswer(f"git does not answer: {error}") from None
    # A comparison of two files ends with 1 if they differ.
    if done.returncode not in (0, int("--no-index" in arguments)):
        said = done.stderr.decode(errors="replace").splitlines() or ["nothing"]
        raise _NoAnswer(f"git says: {said[0]}")
    return done.stdout


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
