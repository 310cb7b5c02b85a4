"""A point on disk, and what its files say about it.

`<results>/points/<identity>/` holds the point's tables, its `log.txt` and, written last, the
`record.json` that makes it count; or the `failure.json` of its last attempt. While an attempt runs,
its process holds `.lock`, which the system frees when that process ends, and `attempt.json` says
who it is. Each of these notes carries its own digest, and the record those of the other files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from experiments.tracking.files import digest, read_file
from experiments.tracking.names import inner_path, is_digest, is_identity, is_name
from experiments.tracking.sealed import SealError, read_sealed, write_sealed
from experiments.tracking.sources import source_hash
from experiments.tracking.trees import canonical_json

# The modules that compute a point and write its tables: named, so that their source counts, and not
# imported. The second counts without what it imports, as that is about records.
_COMPUTES, _WRITES = "experiments.point.run", "experiments.sweep.record"


class State(StrEnum):
    """What is known of a point."""

    DONE = "done"
    STALE = "stale"  # finished, with other source than that of now
    FAILED = "failed"
    RUNNING = "running"  # in this sweep or another, on this machine or another
    MISSING = "missing"
    SHIPPED = "shipped"  # not here, but in tables that came without it; never of a sweep's points


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
        return cls(results, _identity(config), config)

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
        return point_source(system_module(self.config))

    @property
    def folder(self) -> Path:
        """Where its files are.

        Raises:
            UnsafePath: its identity is no plain name, or the folder is a link.
        """
        return inner_path(self.results, "points", self.identity)

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
        try:
            return self._whole_record()
        except (OSError, ValueError):
            return None

    def damage(self) -> str | None:
        """Why a record that is there does not count; None if it counts, or if there is none."""
        try:
            self._whole_record()
        except FileNotFoundError as error:
            return None if error.filename == str(self.folder / "record.json") else _reason(error)
        except (OSError, ValueError) as error:
            return _reason(error)
        return None

    def _whole_record(self) -> dict[str, Any]:
        """The record; raises an OSError or ValueError if it or a file that it lists is damaged."""
        record = self._read_note("record")
        for name, recorded in record["files"].items():
            if digest(read_file(self.folder / name)) != recorded:
                raise SealError(f"{self.folder / name} is not as the point wrote it")
        return record

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
        """Content of `record`, `failure` or `attempt`, or None unless it is whole and this point's.

        The files that a record lists may be damaged all the same.
        """
        try:
            return self._read_note(name)
        except (OSError, ValueError):
            return None

    def write_note(self, name: str, content: Mapping[str, Any]) -> None:
        """Write `record`, `failure` or `attempt`."""
        write_sealed(self.folder / f"{name}.json", content)

    def _read_note(self, name: str) -> dict[str, Any]:
        """A note; raises an OSError or ValueError if it is damaged or another point's."""
        path = self.folder / f"{name}.json"
        content = read_sealed(path)
        if content.get("identity") != self.identity:
            raise SealError(f"{path} is of another point")
        if name == "record":
            _check_record(path, content)
        return content


def system_module(config: Mapping[str, Any]) -> str:
    """The module of the system in a point's config; empty if it is not known."""
    system = config.get("system")
    target = system.get("target", "") if isinstance(system, Mapping) else ""
    return str(target).rpartition(".")[0]


def point_source(module: str) -> str:
    """Hash of all the source, as it is now, that a point with a module's system depends on."""
    return source_hash([_COMPUTES, module], alone=[_WRITES])


def _identity(config: Mapping[str, Any]) -> str:
    """The identity of the point of a config."""
    return digest(canonical_json(config))[:32]


def _check_record(path: Path, record: Mapping[str, Any]) -> None:
    """Raise unless a record names files and stages as points do, and is of its own config."""
    try:
        is_whole = (
            _identity(record["config"]) == record["identity"]
            and all(is_name(name) and is_digest(it) for name, it in record["files"].items())
            and all(is_name(name) and is_identity(it) for name, it in record["stages"].items())
            and (record["git"]["diff"] is None or is_name(record["git"]["diff"]))
        )
    except (KeyError, TypeError, AttributeError, ValueError):
        is_whole = False
    if not is_whole:
        raise SealError(f"{path} is no record of this point")


def _reason(error: Exception) -> str:
    """An error on one line."""
    return f"{error.filename}: {error.strerror}" if isinstance(error, OSError) else str(error)
