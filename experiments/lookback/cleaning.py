"""What no study uses, and its removal."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from experiments.lookback.archive import Archive, ArchiveError
from experiments.tracking.files import PART

_DEAD_AFTER = 3600.0  # [s] nobody takes this long to write one file


@dataclass(frozen=True)
class Leftover:
    """Something that can go.

    Attributes:
        what: in a few words.
        paths: its files and folders, in the order in which they must go.
        lock: held by whoever uses it; None if nobody can.
    """

    what: str
    paths: tuple[Path, ...]
    lock: Path | None

    @property
    def size(self) -> int:
        """Bytes on disk."""
        return sum(_size(path) for path in self.paths)

    def remove(self) -> bool:
        """Remove it, unless somebody uses it; whether it is gone."""
        if self.lock is None:
            _remove(self.paths)
            return True
        try:
            with FileLock(self.lock).acquire(blocking=False):
                _remove((*self.paths, self.lock))
                return True
        except Timeout:
            return False


def clean(archive: Archive, *, remove: bool) -> Iterator[str]:
    """A line for each thing that no study uses; removed if asked for.

    Raises:
        ArchiveError: some study cannot be read, so nobody knows what it uses.
    """
    unused, notes = leftovers(archive)
    yield from notes
    total = 0
    for leftover in unused:
        size = leftover.size
        if remove and not leftover.remove():
            yield f"kept: {leftover.what}: in use now"
            continue
        total += size
        yield f"{'removed' if remove else 'unused'}: {leftover.what} ({size / 1e6:.2f} MB)"
    if not unused:
        yield "nothing to clean"
    elif remove:
        yield f"{total / 1e6:.1f} MB freed"
    else:
        yield f"{len(unused)} things, {total / 1e6:.1f} MB; nothing is removed without --yes"


def leftovers(archive: Archive) -> tuple[list[Leftover], list[str]]:
    """All that no study uses, and notes on what is kept although it may be of no use.

    Raises:
        ArchiveError: some study cannot be read, so nobody knows what it uses.
    """
    if archive.unreadable:
        raise ArchiveError("\n".join(["nothing is cleaned:", *archive.unreadable]))
    used = {identity for study in archive.studies.values() for identity in study.points}
    for study in archive.studies.values():
        used.update(study.collated.points if study.collated else ())
    points = {identity: facts.point for identity, facts in archive.points.items()}
    running = {identity for identity, point in points.items() if point.is_running()}
    unused = [
        Leftover(
            f"point {identity[:12]}, in no study",
            # Without its record, a point that is half removed does not count as done.
            (point.folder / "record.json", point.folder),
            point.folder / ".lock",
        )
        for identity, point in points.items()
        if identity not in used | running
    ]
    notes = [f"point {name[:12]} is kept: it is running" for name in sorted(running - used)]
    records = [points[name].note("record") if name in points else None for name in sorted(used)]
    if running or not all(records):
        notes.append("the store is kept: some study is running, or not finished")
    else:
        unused += _unused_entries(archive.results, [record for record in records if record])
    unused += _dead_files(archive.results, {leftover.paths[-1] for leftover in unused})
    return unused, notes


def _unused_entries(results: Path, records: list[dict[str, Any]]) -> Iterator[Leftover]:
    """Entries of the store, and diffs of the source, that no record names."""
    keys = {(stage, key) for record in records for stage, key in record["stages"].items()}
    entries = {(path.parent.name, path.stem) for path in results.glob("store/*/[!.]*")}
    for stage, key in sorted(entries - keys):
        folder = results / "store" / stage
        paths = (folder / f"{key}.json", folder / f"{key}.npz")
        yield Leftover(f"stored {stage} {key[:12]}", paths, folder / f"{key}.lock")
    diffs = {record["git"].get("diff") for record in records}
    for path in sorted(results.glob("diffs/[!.]*")):
        if path.name not in diffs:
            yield Leftover(f"diff {path.name[:12]}", (path,), None)


def _dead_files(results: Path, covered: set[Path]) -> Iterator[Leftover]:
    """Half-written files of processes that are gone."""
    for path in sorted(results.rglob(f".*{PART}")):
        if not covered.intersection(path.parents):
            with suppress(FileNotFoundError):
                if time.time() - path.stat().st_mtime > _DEAD_AFTER:
                    yield Leftover("half-written file of a dead run", (path,), None)


def _size(path: Path) -> int:
    """Bytes of a file, or of all files in a folder; 0 if it is gone."""
    with suppress(FileNotFoundError):
        inside = path.rglob("*") if path.is_dir() else [path]
        return sum(file.stat().st_size for file in inside if file.is_file())
    return 0


def _remove(paths: tuple[Path, ...]) -> None:
    """Remove files and folders in turn; those that are gone are fine."""
    for path in paths:
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)
