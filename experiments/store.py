"""Arrays that many points share, stored by the content of what they depend on.

An entry is `<stage>/<key>.npz` and, written after it, `<key>.json`: what the key was made from
and a digest of the arrays. An entry that does not match its digest is computed again, never used.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import io
import json
import logging
import os
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO

import numpy as np
from filelock import FileLock
from numpy.typing import NDArray

from experiments.schema import plain

_log = logging.getLogger(__name__)

Arrays = Mapping[str, NDArray[Any]]

PART = ".part"  # the end of the names of files that are being written


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
            folder = self.folder / stage
            folder.mkdir(parents=True, exist_ok=True)
            # Whoever comes second waits here, and then reads.
            with FileLock(folder / f"{key}.lock"):
                arrays = _read_entry(folder, key)
                if arrays is None:
                    arrays = dict(compute())
                    _write_entry(folder, key, arrays, made_from)
        return Stored(key, arrays)

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Count the time of a block for a stage of the point's record."""
        start = time.perf_counter()
        try:
            yield
        finally:
            spent = time.perf_counter() - start
            self.seconds[stage] = self.seconds.get(stage, 0.0) + spent


def canonical_json(value: Any) -> bytes:
    """One spelling for equal values: sorted keys, shortest exact numbers, no spaces.

    Raises:
        TypeError: something that is neither settings nor JSON, an array for one.
        ValueError: NaN or infinity.
    """
    text = json.dumps(plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.encode()


def digest(data: bytes) -> str:
    """sha256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def replace_file(path: Path, data: bytes) -> None:
    """Write a file so that, whatever happens, it is the old one or the new one."""
    with replacing(path) as file:
        file.write(data)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write, which takes the place of the old one once all of it is on disk.

    Its attribute `name` is the path that it has until then.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}-", suffix=PART)
    os.close(handle)
    try:
        with open(name, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


def source_hash(modules: Iterable[str]) -> str:
    """Hash of the source of named modules and of all that they import from their own packages.

    A module that is in no package counts with those that lie beside it. Sources are read, never
    run: a name may come from a file of results.
    """
    sources: dict[str, str] = {}
    waiting = list(modules)
    packages = {name.partition(".")[0] for name in waiting} | {"mlci"}
    packages |= {other for name in waiting if "." not in name for other in _beside(name)}
    while waiting:
        name = waiting.pop()
        if name not in sources:
            sources[name], imported = _read_source(name)
            waiting += [other for other in imported if other.partition(".")[0] in packages]
    return digest(canonical_json(sources))


@cache
def _beside(name: str) -> frozenset[str]:
    """Modules and packages in the folder of a module that somebody wrote for a study."""
    spec = _find(name)
    if spec is None or spec.origin is None or not os.path.isfile(spec.origin):
        return frozenset()
    folder = Path(spec.origin).parent
    if folder.name == "site-packages":
        return frozenset()
    return frozenset(path.stem for path in folder.iterdir() if path.suffix in ("", ".py"))


@cache
def _read_source(name: str) -> tuple[str, tuple[str, ...]]:
    """Digest of a module's source, and the modules that it imports."""
    spec = _find(name)
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return "", ()
    data = Path(spec.origin).read_bytes()
    found: list[str] = []
    for node in ast.walk(ast.parse(data)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = "." * node.level + (node.module or "")
            origin = importlib.util.resolve_name(start, spec.parent)
            found.append(origin)
            # `from package import module` names a module only if it is one.
            inner = [f"{origin}.{alias.name}" for alias in node.names]
            found += [other for other in inner if other in _module_names(origin)]
    return digest(data), tuple(found)


def _find(name: str) -> ModuleSpec | None:
    """Where a module is, found without running the packages that it is in."""
    top, *inner = name.split(".")
    try:
        spec = importlib.util.find_spec(top)
    except (ImportError, ValueError):
        return None
    for part in inner:
        if spec is None or spec.submodule_search_locations is None:
            return None
        spec = PathFinder.find_spec(f"{spec.name}.{part}", spec.submodule_search_locations)
    return spec


@cache
def _module_names(package: str) -> frozenset[str]:
    """Full names of the modules inside a package; none if it is a plain module."""
    spec = _find(package)
    folders = spec.submodule_search_locations if spec else None
    paths = [path for folder in folders or () for path in Path(folder).iterdir()]
    return frozenset(f"{package}.{path.stem}" for path in paths if path.suffix in ("", ".py"))


def _read_entry(folder: Path, key: str) -> dict[str, NDArray[Any]] | None:
    """The arrays of an entry, or None if there is none that is whole."""
    note, arrays = folder / f"{key}.json", folder / f"{key}.npz"
    if not note.exists():
        return None
    try:
        data = arrays.read_bytes()
        if digest(data) != json.loads(note.read_bytes())["digest"]:
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
    note = {**made_from, "digest": digest(data)}
    replace_file(folder / f"{key}.json", json.dumps(note, indent=1).encode() + b"\n")
