"""A point on disk, and what its files say about it.

`<results>/points/<identity>/` holds the point's tables, its `log.txt` and, written last, the
`record.json` that makes it count; or the `failure.json` of its last attempt. While an attempt runs,
its process holds `.lock`, which the system frees when that process ends, and `attempt.json` says
who it is.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from experiments.tracking.files import digest
from experiments.tracking.sources import source_hash
from experiments.tracking.trees import canonical_json

# The module that computes a point: named, so that its source counts, and not imported.
POINT_CODE = "experiments.point.run"


class State(StrEnum):
    """What is known of a point."""

    DONE = "done"
    STALE = "stale"  # finished, with other source than that of now
    FAILED = "failed"
    RUNNING = "running"  # in this sweep or another, on this machine or another
    MISSING = "missing"


@dataclass(frozen=True)
class Point:
    """A point and where it is on disk.

    Attributes:
        results: the folder of all results.
        identity: the point's name, a hash of its config.
    """

    results: Path
    identity: str
    _planned: Mapping[str, Any] | None = field(default=None, repr=False, compare=False)

    @classmethod
    def planned(cls, config: Mapping[str, Any], results: Path) -> Point:
        """The point of a config: one, whatever study or spelling the config comes from.

        Args:
            config: all that decides the point's result, as plain nested values.
            results: the folder of all results.
        """
        return cls(results, digest(canonical_json(config))[:32], config)

    @cached_property
    def config(self) -> Mapping[str, Any]:
        """Its config as planned, or as its record has it; empty if neither is known."""
        if self._planned is not None:
            return self._planned
        config: Mapping[str, Any] = (self.record() or {}).get("config", {})
        return config

    @cached_property
    def source(self) -> str:
        """Hash of all the source that the result depends on, as it is now; runs none of it."""
        target = str(self.config.get("system", {}).get("target", ""))
        return source_hash([POINT_CODE, target.rpartition(".")[0]])

    @property
    def folder(self) -> Path:
        return self.results / "points" / self.identity

    @property
    def lock(self) -> FileLock:
        """Held by the process that runs the point; a new object each time, as each is a holder."""
        return FileLock(self.folder / ".lock")

    def state(self) -> State:
        """What is known of the point; writes nothing."""
        record = self.record()
        if record is not None and record.get("source") == self.source:
            return State.DONE
        if self.is_running():
            return State.RUNNING
        if record is not None:
            return State.STALE
        return State.MISSING if self.failure() is None else State.FAILED

    def record(self) -> dict[str, Any] | None:
        """The record, or None unless this point finished and its files are as they were written."""
        record = self.note("record")
        try:
            files = record["files"].items() if record else ()
            unchanged = all(
                digest((self.folder / name).read_bytes()) == recorded for name, recorded in files
            )
        except (OSError, KeyError, TypeError, AttributeError):
            return None
        return record if unchanged else None

    def failure(self) -> dict[str, Any] | None:
        """How the last attempt failed, or None if it did not."""
        return self.note("failure")

    def is_done(self, after: int = 0) -> bool:
        """Whether it finished, with the source as it is now, in a later attempt than `after`."""
        record = self.record()
        if record is None or record.get("source") != self.source:
            return False
        return int(record.get("attempt", 1)) > after

    def attempts(self) -> int:
        """Number of the last attempt, however it ended; 0 if there was none."""
        notes = [self.note(name) or {} for name in ("attempt", "failure", "record")]
        return max(int(note.get("attempt", 0)) for note in notes)

    def is_running(self) -> bool:
        """Whether a live process holds the lock."""
        if not (self.folder / ".lock").exists():
            return False
        try:
            with self.lock.acquire(blocking=False):
                return False
        except Timeout:
            return True

    def note(self, name: str) -> dict[str, Any] | None:
        """Content of `record`, `failure` or `attempt`, or None unless it is this point's."""
        try:
            content: dict[str, Any] = json.loads((self.folder / f"{name}.json").read_bytes())
            return content if content["identity"] == self.identity else None
        except (OSError, ValueError, KeyError, TypeError):
            return None
