"""Arrays that many points share, stored by the content of what they depend on.

An entry is `<stage>/<key>.npz` and, written after it, `<key>.json`: what the key was made from
and a digest of the file of arrays. An entry that does not match its digest is computed again, never
used.
"""

from __future__ import annotations

import io
import logging
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from filelock import FileLock
from numpy.typing import NDArray

from experiments.progress import begin
from experiments.tracking.files import digest, read_file, replace_file
from experiments.tracking.names import inner_path
from experiments.tracking.sealed import read_sealed, write_sealed
from experiments.tracking.sources import source_hash
from experiments.tracking.trees import canonical_json, plain

_log = logging.getLogger(__name__)

Arrays = Mapping[str, NDArray[Any]]


class Stored(dict[str, NDArray[Any]]):
    """Arrays by name, and the `key` that they are stored under, for what depends on them."""

    def __init__(self, key: str, arrays: Arrays) -> None:
        super().__init__(arrays)
        self.key = key


class Store:
    """A folder of entries, safe for any number of processes.

    Attributes:
        seconds: time spent in each stage so far, for the record of a point.
        keys: key of each stage that was asked for.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.seconds: dict[str, float] = {}
        self.keys: dict[str, str] = {}

    def get(
        self,
        stage: str,
        depends: Any,
        modules: Iterable[ModuleType],
        compute: Callable[[], Arrays],
    ) -> Stored:
        """The arrays of a stage, computed once for all points and processes.

        Args:
            stage: name of what is computed; also its folder.
            depends: everything that the arrays depend on besides code: settings (dataclasses,
                mappings, lists, scalars) and the keys of the stages before.
            modules: the modules that do the work; those of this project that they import count too.
            compute: makes the arrays, none of them of Python objects.
        """
        source = source_hash([module.__name__ for module in modules])
        made_from = {"stage": stage, "depends": plain(depends), "source": source}
        key = digest(canonical_json(made_from))[:32]
        self.keys[stage] = key
        with self.timed(stage):
            folder = inner_path(self.folder.parent, self.folder.name, stage)
            folder.mkdir(parents=True, exist_ok=True)
            # Whoever comes second waits here, and then reads.
            with FileLock(folder / f"{key}.lock"):
                arrays = _read_entry(folder, key)
                if arrays is None:
                    begin(f"computing {stage.replace('_', ' ')}, which later runs share")
                    arrays = dict(compute())
                    _write_entry(folder, key, arrays, made_from)
        return Stored(key, arrays)

    def read(self, stage: str, key: str) -> Stored | None:
        """The arrays of a stage under a key that a point's record has; None if they are gone."""
        try:
            folder = inner_path(self.folder.parent, self.folder.name, stage)
        except OSError:
            return None
        arrays = _read_entry(folder, key)
        return None if arrays is None else Stored(key, arrays)

    def entries(self, stage: str) -> Iterator[tuple[dict[str, Any], Stored]]:
        """Every whole entry of a stage: what its key was made from, and its arrays."""
        try:
            folder = inner_path(self.folder.parent, self.folder.name, stage)
        except OSError:
            return
        for note in sorted(folder.glob("*.json")):
            arrays = _read_entry(folder, note.stem)
            if arrays is not None:
                yield read_sealed(note), Stored(note.stem, arrays)

    def copy(self, stage: str, key: str, other: Store) -> bool:
        """Copy an entry into another store; False if there is none that is whole."""
        if self.read(stage, key) is None:
            return False
        for name in (f"{key}.npz", f"{key}.json"):
            data = read_file(self.folder / stage / name)
            replace_file(other.folder / stage / name, data)
        return True

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Count the time of a block for a stage of the point's record."""
        start = time.perf_counter()
        try:
            yield
        finally:
            spent = time.perf_counter() - start
            self.seconds[stage] = self.seconds.get(stage, 0.0) + spent


def _read_entry(folder: Path, key: str) -> dict[str, NDArray[Any]] | None:
    """The arrays of an entry, or None if there is none that is whole."""
    note, arrays = folder / f"{key}.json", folder / f"{key}.npz"
    if not note.exists():
        return None
    try:
        data = read_file(arrays)
        if digest(data) != read_sealed(note)["arrays"]:
            raise ValueError("it does not match its digest")
        with np.load(io.BytesIO(data), allow_pickle=False) as entry:
            return {name: entry[name] for name in entry.files}
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        _log.warning("stored %s is damaged and is computed again: %s", arrays, error)
        return None


def _write_entry(folder: Path, key: str, arrays: Arrays, made_from: Mapping[str, Any]) -> None:
    """Write the arrays, then the note that makes them count."""
    for name, array in arrays.items():
        if np.asarray(array).dtype.hasobject:
            raise TypeError(f"{folder.name}: array {name!r} holds Python objects, never stored")
    buffer = io.BytesIO()
    whole: dict[str, Any] = {name: np.asarray(array) for name, array in arrays.items()}
    np.savez(buffer, **whole)
    data = buffer.getvalue()
    (folder / f"{key}.json").unlink(missing_ok=True)
    replace_file(folder / f"{key}.npz", data)
    write_sealed(folder / f"{key}.json", {**made_from, "arrays": digest(data)})
