"""Locks between sweeps, and between sweeps and cleaning: files in `<results>/.locks`.

The system frees a lock when its process ends, however that ends.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from experiments.tracking.files import digest


class StudyInUse(Exception):
    """A sweep of other points has the study's name now."""


def plan_lock(results: Path) -> FileLock:
    """Held while a study's plan is written, and while unused points are moved away.

    So nothing goes that a plan has just come to name.
    """
    return _lock(results / ".locks", "plans")


def publication_lock(folder: Path) -> FileLock:
    """Held while the tables of a study are made and take their place."""
    return _lock(_locks_of(folder), "tables")


@contextmanager
def sweep_lock(folder: Path, points: Iterable[str]) -> Iterator[None]:
    """Hold a study's name for a sweep, from its plan until its tables have taken their place.

    Sweeps of the same points hold it together, as they divide the work.

    Args:
        folder: the study's.
        points: identities of the sweep's points.

    Raises:
        StudyInUse: a sweep of other points holds it.
    """
    plan = digest("\n".join(sorted(points)).encode())[:32]
    locks = _locks_of(folder)
    own = _lock(locks, f"{plan}-{secrets.token_hex(4)}.sweep")
    with _lock(locks, "sweeps"):
        for path in sorted(locks.glob("*.sweep.lock")):
            if not _is_held(path):
                path.unlink()  # of a sweep that was killed
            elif not path.name.startswith(plan):
                raise StudyInUse(
                    f"study: {folder.name} is being written by another sweep, of other points; "
                    "wait until it has ended, or give this one a name of its own, study=..."
                )
        own.acquire()
    try:
        yield
    finally:
        own.release()
        Path(own.lock_file).unlink(missing_ok=True)


def _locks_of(folder: Path) -> Path:
    """Where a study's locks are."""
    return folder.parent / ".locks" / folder.name


def _lock(folder: Path, name: str) -> FileLock:
    """A lock, in a folder that is made for it."""
    folder.mkdir(parents=True, exist_ok=True)
    return FileLock(os.fspath(folder / f"{name}.lock"))


def _is_held(path: Path) -> bool:
    """Whether a live process holds a lock."""
    try:
        with FileLock(path).acquire(blocking=False):
            return False
    except Timeout:
        return True
