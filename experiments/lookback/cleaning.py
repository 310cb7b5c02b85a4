"""What no study uses: listed, moved into the trash, and removed from there by a second command."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from experiments.lookback.archive import Archive, ArchiveError, reason
from experiments.tracking.files import PART, read_file
from experiments.tracking.locks import plan_lock
from experiments.tracking.names import inner_path, is_identity, is_name

_DEAD_AFTER = 3600.0  # [s] nobody takes this long to write one file
_TRASH = "trash"


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

    def move(self, results: Path, trash: Path) -> bool:
        """Move it from the folder of results into the trash; False if somebody uses it."""
        try:
            with FileLock(self.lock).acquire(blocking=False) if self.lock else nullcontext():
                for path in self.paths:
                    target = trash / path.relative_to(results)
                    target.parent.mkdir(parents=True, exist_ok=True)
                    with suppress(FileNotFoundError):
                        path.rename(target)
        except Timeout:
            return False
        return True


def clean(archive: Archive, *, remove: bool) -> Iterator[str]:
    """A line for each thing that no study uses; moved into the trash if asked for.

    Raises:
        ArchiveError: something cannot be read, so nobody knows what is used.
    """
    if not archive.results.is_dir():
        yield "nothing to clean"
        return
    try:
        if remove:
            with plan_lock(archive.results):  # from here on no study comes to name anything
                yield from _clean(Archive(archive.results), remove=True)
        else:
            yield from _clean(archive, remove=False)
    except OSError as error:
        raise ArchiveError(f"nothing more is cleaned: {reason(error)}") from None


def empty_trash(results: Path) -> Iterator[str]:
    """Remove all that `clean` moved into the trash; a line for each time that it did.

    Raises:
        ArchiveError: the trash cannot be removed.
    """
    try:
        trash = inner_path(results, _TRASH)
        folders = sorted(trash.iterdir()) if trash.is_dir() else []
        for folder in folders:
            size = _size(inner_path(trash, folder.name))
            shutil.rmtree(folder)
            yield f"removed: {folder} ({size / 1e6:.2f} MB)"
    except OSError as error:
        raise ArchiveError(reason(error)) from None
    if not folders:
        yield f"nothing in {trash}"


def _clean(archive: Archive, *, remove: bool) -> Iterator[str]:
    """The lines of `clean`."""
    unused, notes = leftovers(archive)
    yield from notes
    if not unused:
        yield "nothing to clean"
        return
    trash, total = _new_trash(archive.results), 0
    for leftover in unused:
        size = leftover.size
        if remove and not leftover.move(archive.results, trash):
            yield f"kept: {leftover.what}: in use now"
            continue
        total += size
        yield f"{'moved' if remove else 'unused'}: {leftover.what} ({size / 1e6:.2f} MB)"
    if remove:
        yield (
            f"{total / 1e6:.1f} MB moved to {trash}; remove it for good with: "
            "python experiments/results.py empty-trash"
        )
    else:
        yield f"{len(unused)} things, {total / 1e6:.1f} MB; nothing is moved without --yes"


def _new_trash(results: Path) -> Path:
    """A folder of the trash that is not there yet, named by the time."""
    trash = inner_path(results, _TRASH)
    name = datetime.now(UTC).strftime("%Y-%m-%dT%H%M%S")
    numbered = (f"{name}-{number}" if number else name for number in range(1000))
    return next(trash / each for each in numbered if not (trash / each).exists())


def leftovers(archive: Archive) -> tuple[list[Leftover], list[str]]:
    """All that no study uses, and notes on what is kept although it may be of no use.

    Raises:
        ArchiveError: something cannot be read, so nobody knows what is used.
        OSError: likewise.
    """
    _refuse_unknown(archive)
    used = {identity for study in archive.studies.values() for identity in study.points}
    for study in archive.studies.values():
        used.update(study.collated.points if study.collated else ())
    points = {identity: facts.point for identity, facts in archive.points.items()}
    running = {identity for identity, point in points.items() if point.is_running()}
    unused = [
        Leftover(f"point {identity[:12]}, in no study", (point.folder,), point.folder / ".lock")
        for identity, point in points.items()
        if identity not in used | running
    ]
    notes = [f"point {name[:12]} is kept: it is running" for name in sorted(running - used)]
    try:
        records = [points[name].note("record") if name in points else None for name in sorted(used)]
    except RecursionError:
        raise ArchiveError("nothing is cleaned: a record.json nests too deep") from None
    if running or not all(records):
        notes.append("the store is kept: some study is running, or not finished")
    else:
        unused += _unused_entries(archive.results, [record for record in records if record])
    unused += _dead_files(archive.results, {path for each in unused for path in each.paths})
    return unused, notes


def _refuse_unknown(archive: Archive) -> None:
    """Raise if something cannot be read, or is perhaps a study that lost its listing."""
    reasons = [
        *archive.unreadable,
        *(
            f"{folder}: has no study.json, so nobody knows which points it uses; move it out of "
            f"{archive.results}, or run its sweep again"
            for folder in archive.without_listing
        ),
        *_unreadable_records(archive),
    ]
    if reasons:
        raise ArchiveError("\n".join(["nothing is cleaned:", *reasons]))


def _unreadable_records(archive: Archive) -> Iterator[str]:
    """Records that are there and cannot be read."""
    for facts in archive.points.values():
        try:
            read_file(facts.point.folder / "record.json")
        except FileNotFoundError:
            continue
        except OSError as error:
            yield f"{error.filename}: {error.strerror}"


def _unused_entries(results: Path, records: list[dict[str, Any]]) -> Iterator[Leftover]:
    """Entries of the store, and diffs of the source, that no record names."""
    keys = {(stage, key) for record in records for stage, key in record["stages"].items()}
    for stage in _names(inner_path(results, "store")):
        folder = inner_path(results, "store", stage)
        for key in sorted({name.partition(".")[0] for name in _names(folder)}):
            if is_identity(key) and (stage, key) not in keys:
                paths = (folder / f"{key}.json", folder / f"{key}.npz", folder / f"{key}.lock")
                yield Leftover(f"stored {stage} {key[:12]}", paths, paths[-1])
    diffs = {record["git"].get("diff") for record in records}
    for name in _names(inner_path(results, "diffs")):
        if name not in diffs:
            yield Leftover(f"diff {name[:12]}", (results / "diffs" / name,), None)


def _names(folder: Path) -> list[str]:
    """Plain names in a folder; none if there is no folder."""
    try:
        return sorted(name for name in os.listdir(folder) if is_name(name))
    except FileNotFoundError:
        return []


def _dead_files(results: Path, covered: set[Path]) -> Iterator[Leftover]:
    """Half-written files and folders of processes that are gone."""

    def refuse(error: OSError) -> None:
        raise error

    for top, folders, files in os.walk(results, onerror=refuse):
        here = Path(top)
        if here in covered or here == results / _TRASH:
            folders.clear()
            continue
        for name in sorted([*folders, *files]):
            if name.startswith(".") and name.endswith(PART):
                with suppress(FileNotFoundError):
                    if time.time() - os.lstat(here / name).st_mtime > _DEAD_AFTER:
                        yield Leftover("half-written file of a dead run", (here / name,), None)


def _size(path: Path) -> int:
    """Bytes of a file, or of all files in a folder; 0 if it is gone."""
    with suppress(FileNotFoundError):
        inside = path.rglob("*") if path.is_dir() else [path]
        return sum(file.lstat().st_size for file in inside)
    return 0
