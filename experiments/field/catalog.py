"""All worlds and methods: those of the benchmark, and those of files that a user adds."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from experiments.field.entries import Method, World
from experiments.field.methods import METHODS
from experiments.field.worlds import mazes, pendulums, plane, recorded, scobee, walls
from experiments.tracking.files import digest, read_file
from experiments.tracking.sources import source_hash


@dataclass(frozen=True)
class Catalog:
    """Worlds and methods by name.

    Attributes:
        worlds: the worlds.
        methods: the methods.
        added: digests of the files that were added, and of what they use of this project, by the
            name of their module; those of folders by their path.
    """

    worlds: dict[str, World]
    methods: dict[str, Method]
    added: dict[str, str]

    def source(self, *functions: object) -> str:
        """A hash of the code that some functions run."""
        modules = {_module(function) for function in functions}
        files = [self.added[name] for name in sorted(modules & self.added.keys())]
        parts = [str(part) for each in functions for part in getattr(each, "args", ())]
        files += [self.added[name] for name in sorted(self.added.keys() & set(parts))]
        own = sorted(modules - self.added.keys() | {"experiments.field.scores"})
        return digest("".join([source_hash(own), *files]).encode())


@cache
def load(added: tuple[Path, ...] = ()) -> Catalog:
    """The catalog with the worlds and methods of some files, and worlds of folders of recordings.

    A folder is as `worlds.recorded` says, and its world has its name. A file has `WORLDS`,
    `METHODS` or both: dictionaries from names to `World` and `Method`.

    Raises:
        ValueError: a file that fails or has neither, an entry that is none, or a name that is there
            already.
    """
    worlds = {
        name: world
        for module in (scobee, pendulums, walls, plane, mazes)
        for name, world in module.WORLDS.items()
    }
    methods = dict(METHODS)
    digests = {}
    for path in added:
        if path.is_dir():
            _add(path, worlds, {f"recorded: {path.name}": recorded.world(path)}, World)
            digests[str(path)] = _digest_of_folder(path)
            continue
        module = _imported(path)
        more = getattr(module, "WORLDS", {}), getattr(module, "METHODS", {})
        if not any(more):
            raise ValueError(f"{path} has neither WORLDS nor METHODS: see experiments/field/README")
        _add(path, worlds, more[0], World)
        _add(path, methods, more[1], Method)
        file = digest(read_file(path.resolve()))
        digests[module.__name__] = f"{file} {source_hash(_of_this_project(module))}"
    return Catalog(worlds, methods, digests)


def _add(path: Path, known: dict[str, Any], more: object, kind: type) -> None:
    """Add the entries of a file or folder to those that are known by name.

    Raises:
        ValueError: something that is no entry, or a name that is none or there already.
    """
    what = f"{path}: {kind.__name__.upper()}S"
    if not isinstance(more, Mapping):
        raise ValueError(f"{what} must be a dictionary by names, not a {type(more).__name__}")
    taken = {_folder_name(name): name for name in known}
    for name, entry in more.items():
        if not isinstance(entry, kind):
            raise ValueError(
                f"{what}[{name!r}] must be a {kind.__name__}, not a {type(entry).__name__}"
            )
        if not isinstance(name, str) or not name.strip(". ") or set(name) & set("/\\\0"):
            raise ValueError(f"{what}: {name!r} names no folder of results: rename it")
        if _folder_name(name) in taken:
            raise ValueError(f"{path}: {taken[_folder_name(name)]} is there already: rename it")
        taken[_folder_name(name)] = name
        known[name] = entry


def _folder_name(name: str) -> str:
    """What of a name distinguishes folders of results."""
    return name.replace(":", "")


def _digest_of_folder(folder: Path) -> str:
    """Of all that its files hold."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    held = [f"{path.relative_to(folder)} {digest(read_file(path))}" for path in files]
    return digest("\n".join(held).encode())


def chosen(known: Sequence[str], names: Sequence[str] | None, what: str) -> list[str]:
    """Some names of those that are known; all if none are given.

    Raises:
        ValueError: a name that is not.
    """
    if unknown := [name for name in names or () if name not in known]:
        raise ValueError(f"no {what} is called {', '.join(unknown)}; there are {', '.join(known)}")
    return [name for name in known if not names or name in names]


def _imported(path: Path) -> ModuleType:
    """The module of a file, as it is now: none that was compiled before, and none left behind.

    Raises:
        ValueError: no such file, or one that fails.
    """
    if not path.is_file():
        raise ValueError(f"{path} is no Python file")
    # Two files may have one name.
    module = ModuleType(f"field_entry_{digest(str(path.resolve()).encode())[:8]}_{path.stem}")
    sys.modules[module.__name__] = module  # dataclasses of the file look for it
    try:
        exec(compile(path.read_text("utf-8"), str(path), "exec"), vars(module))
    except (Exception, SystemExit) as error:  # it may be anybody's file
        del sys.modules[module.__name__]
        lines = [
            each.lineno
            for each in traceback.extract_tb(error.__traceback__)
            if each.filename == str(path)
        ]
        where = f", line {lines[-1]}" if lines else ""
        raise ValueError(f"{path}{where} fails: {type(error).__name__}: {error}") from error
    return module


def _of_this_project(module: ModuleType) -> list[str]:
    """The modules of this project whose functions and classes a module uses by name."""
    names = {
        str(getattr(value, "__module__", None) or getattr(value, "__name__", ""))
        for value in vars(module).values()
    }
    return sorted(name for name in names if name.partition(".")[0] in ("experiments", "mlci"))


def _module(function: object) -> str:
    """The name of the module in which a function, or what `partial` made of it, is written."""
    return str(getattr(getattr(function, "func", function), "__module__", ""))
