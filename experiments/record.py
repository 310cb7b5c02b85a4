"""A point on disk: its tables, its log and, written last, the record that makes it count."""

from __future__ import annotations

import json
import os
import platform
import resource
import socket
import subprocess
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, cached_property
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from experiments import point
from experiments.schema import plain
from experiments.settings import Settings
from experiments.store import Store, canonical_json, digest, replace_file, source_hash
from experiments.tables import table_bytes

CHECKOUT = Path(__file__).resolve().parents[1]

_PACKAGES = ("mlci", "numpy", "scipy", "pandas", "hydra-core", "omegaconf")


@dataclass(frozen=True)
class Point:
    """A point and where it is kept.

    Attributes:
        settings: what decides its result.
        results: the folder of all results.
    """

    settings: Settings
    results: Path

    @cached_property
    def identity(self) -> str:
        """Hash of the settings: one for a point, whatever study or spelling it comes from."""
        return digest(canonical_json(self.settings))[:32]

    @property
    def folder(self) -> Path:
        return self.results / "points" / self.identity

    @cached_property
    def source(self) -> str:
        """Hash of all the project's source that the result depends on."""
        return source_hash([point, import_module(type(self.settings.model).__module__)])

    def record(self) -> dict[str, Any] | None:
        """The record, or None unless this point finished and its files are as they were written."""
        try:
            record: dict[str, Any] = json.loads((self.folder / "record.json").read_bytes())
            files = record["files"].items()
            whole = all(digest((self.folder / name).read_bytes()) == was for name, was in files)
            return record if whole and record["identity"] == self.identity else None
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None

    def is_done(self) -> bool:
        """Whether it finished, with the source as it is now."""
        record = self.record()
        return record is not None and record.get("source") == self.source

    def run(self, log: Callable[[str], None]) -> None:
        """Compute the point and keep its tables, log and record.

        Args:
            log: called with each line that the point prints.
        """
        started = datetime.now(UTC).isoformat(timespec="seconds")
        # A point that runs again, and fails, must not look finished.
        (self.folder / "record.json").unlink(missing_ok=True)
        lines: list[str] = []

        def keep(line: str) -> None:
            lines.append(line)
            log(line)

        store = Store(self.results / "store")
        try:
            with store.timed("total"):
                tables = point.run_point(self.settings, store, keep)
        except Exception:
            lines.append(traceback.format_exc())
            raise
        finally:
            text = "".join(f"{line}\n" for line in lines)
            replace_file(self.folder / "log.txt", text.encode())
        files = {"log.txt": digest(text.encode())}
        for name, frame in sorted(tables.items()):
            data = table_bytes(name, frame, self.settings)
            files[f"{name}.csv"] = digest(data)
            replace_file(self.folder / f"{name}.csv", data)
        record = {
            "identity": self.identity,
            "source": self.source,
            "config": plain(self.settings),
            "seed": self.settings.seed,
            "files": files,
            "stages": store.keys,
            "seconds": {stage: round(spent, 3) for stage, spent in store.seconds.items()},
            "started": started,
            # Of the process, which may have run other points before this one.
            "peak_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
            **surroundings(),
        }
        data = json.dumps(record, indent=1, allow_nan=False).encode() + b"\n"
        replace_file(self.folder / "record.json", data)


def surroundings() -> dict[str, Any]:
    """The code, the packages and the machine that a result comes from."""
    return {
        "git": git_state(),
        "host": socket.gethostname(),
        "system": platform.platform(),
        "cores": os.cpu_count(),
        "blas_threads": os.environ.get("OMP_NUM_THREADS"),
        "python": sys.version.split()[0],
        "packages": _versions(),
    }


@cache
def git_state() -> dict[str, Any]:
    """Commit of the checkout, and whether anything but results differs from it."""
    commit = _git("rev-parse", "HEAD")
    changes = _git("status", "--porcelain", "--", ".", ":(exclude)results")
    return {"commit": commit, "dirty": None if changes is None else bool(changes)}


def _git(*arguments: str) -> str | None:
    """Output of a git command in the checkout, or None where there is no git or no commit."""
    try:
        done = subprocess.run(
            ["git", *arguments], cwd=CHECKOUT, capture_output=True, text=True, timeout=30
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


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
