"""All worlds and methods: those of the benchmark, and those of files that a user adds."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType

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
            name of their module.
    """

    worlds: dict[str, World]
    methods: dict[str, Method]
    added: dict[str, str]

    def source(self, *functions: object) -> str:
        """A hash of the code that some functions run."""
        modules = {_module(function) for function in functions}
        files = [self.added[name] for name in sorted(modules & self.added.keys())]
        own = sorted(modules - self.added.keys() | {"experiments.field.scores"})
        return digest("".join([source_hash(own), *files]).encode())


@cache
def load(added: tuple[Path, ...] = ()) -> Catalog:
    """The catalog with the worlds and methods of some files, and worlds of folders of recordings.

    A folder is as `worlds.recorded` says, and its world has its name. A file has `WORLDS`,
    `METHODS` or both: dictionaries from names to `World` and `Method`.

    Raises:
        ValueError: a file without either, or a name that is there already.
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
            worlds[f"recorded: {path.name}"] = recorded.world(path)
            continue
        module = _imported(path)
        more = getattr(module, "WORLDS", {}), getattr(module, "METHODS", {})
        if not any(more):
            raise ValueError(f"{path} has neither WORLDS nor METHODS: see experiments/field/README")
        for known, new in zip((worlds, methods), more, strict=True):
            if twice := known.keys() & new.keys():
                raise ValueError(f"{path}: {', '.join(sorted(twice))} is there already: rename it")
            known.update(new)
        file = digest(read_file(path.resolve()))
        digests[module.__name__] = f"{file} {source_hash(_of_this_project(module))}"
    return Catalog(worlds, methods, digests)


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
        ValueError: no such file.
    """
    if not path.is_file():
        raise ValueError(f"{path} is no Python file")
    module = ModuleType(f"field_entry_{path.stem}")
    sys.modules[module.__name__] = module  # dataclasses of the file look for it
    exec(compile(path.read_text(), str(path), "exec"), vars(module))
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
