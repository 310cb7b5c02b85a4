"""The source code that a result depends on, and the packages that decide its numbers, as a hash.

Code counts by its syntax tree. What changes no result is left out: comments, docstrings, layout,
and what is said to people, by `print`, `log` or a logger.
"""

from __future__ import annotations

import ast
import importlib.util
import os
import sys
from collections.abc import Iterable
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from experiments.tracking.files import digest
from experiments.tracking.source_memory import SourceMemory
from experiments.tracking.trees import canonical_json

# Imports from these packages count wherever they occur, by their source; others by their version.
_PROJECT = ("experiments", "mlci", "paper_figures")
# Packages that decide no number: what reads configs, guards files, draws bars.
_PLUMBING = {
    "filelock",
    "hydra",
    "omegaconf",
    "pebble",
    "pydantic",
    "pydantic_core",
    "tqdm",
    "yaml",
}
# Modules that word and show what is said to people, and what says it.
_WORDS = ("experiments.console", "experiments.terminal", "experiments.progress")
_SPEAKERS = {"print", "log", "_log", "write_line", "begin"}
# Whose files are remembered: all in the checkout, or beside an installed wheel.
_ROOT = Path(__file__).parents[2]
_MEMORY = SourceMemory(__file__)


def source_hash(modules: Iterable[str], alone: Iterable[str] = ()) -> str:
    """Hash of the source of some modules and of all that they import, directly or not.

    Imports count from this project and from the packages of the modules themselves; for a module
    in no package, from the modules and packages in its folder. Of other packages the version
    counts. Sources are read, never run: a name may come from a file of results.

    Args:
        modules: their full names.
        alone: more modules, which count without what they import.
    """
    return _hash(frozenset(modules), frozenset(alone))


@cache
def _hash(modules: frozenset[str], alone: frozenset[str]) -> str:
    """The same, remembered: every point of a sweep asks for that of its system."""
    sources: dict[str, str] = {}
    outside: set[str] = set()
    waiting = list(modules)
    packages = {name.partition(".")[0] for name in waiting}.union(_PROJECT)
    packages.update(*(_neighbours(name) for name in waiting if "." not in name))
    while waiting:
        name = waiting.pop()
        if name in sources or name in _WORDS:
            continue
        sources[name], imported = _read_source(name)
        for other in imported:
            top = other.partition(".")[0]
            if top in packages:
                waiting.append(other)
            else:
                outside.add(top)
    sources |= {name: _read_source(name)[0] for name in alone}
    _MEMORY.save()
    versions = {name: it for name in outside if (it := _version(name)) is not None}
    return digest(canonical_json({"sources": sources, "versions": versions}))


@cache
def _version(package: str) -> str | None:
    """Version of an installed package, or None if it decides no number."""
    if package in sys.stdlib_module_names or package in _PLUMBING:
        return None
    try:
        return version(package)
    except (PackageNotFoundError, ValueError):
        return None


@cache
def _neighbours(name: str) -> frozenset[str]:
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
    is_ours = Path(spec.origin).is_relative_to(_ROOT)
    code, imports = _MEMORY.recall(spec.origin, _parsed) if is_ours else _parsed(spec.origin)
    imported: list[str] = []
    for start, names in imports:
        if names is None:
            imported.append(start)
            continue
        origin = importlib.util.resolve_name(start, spec.parent)
        imported.append(origin)
        # `from package import module` names a module only if it is one.
        inner = [f"{origin}.{name}" for name in names]
        imported += [other for other in inner if other in _module_names(origin)]
    return code, tuple(imported)


def _parsed(path: str) -> list[Any]:
    """Digest of the code of a file; and its imports, each with the names that it takes from there.

    No names are those of `import module`, an empty list that of none.
    """
    tree = ast.parse(Path(path).read_bytes())
    imports: list[list[Any]] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imports += [[alias.name, None] for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = "." * node.level + (node.module or "")
            imports.append([start, [alias.name for alias in node.names]])
    return [digest("\n".join(_words(tree)).encode()), imports]


def _words(tree: ast.AST) -> list[str]:
    """A syntax tree as words, without what changes no result; the same for all versions of Python.

    A field that is empty is left out, as some versions have more of them than others.
    """
    words: list[str] = []

    def add(node: ast.AST) -> None:
        words.append(f"({type(node).__name__}")
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(value, ast.AST):
                words.append(name)
                add(value)
            elif isinstance(value, list):
                if name == "body":
                    value = [part for part in value if not _is_silent(part)]
                if value:
                    words.append(f"{name}[")
                    for part in value:
                        if isinstance(part, ast.AST):
                            add(part)
                        else:
                            words.append(repr(part))
                    words.append("]")
            elif value is not None and name not in ("kind", "type_comment"):
                words.append(f"{name}={value!r}")
        words.append(")")

    add(tree)
    return words


def _is_silent(node: ast.AST) -> bool:
    """Whether a statement changes no result: a text of its own, or a call that says something."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return True
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        speaker = node.value.func
        while isinstance(speaker, ast.Attribute):
            speaker = speaker.value
        return isinstance(speaker, ast.Name) and speaker.id in _SPEAKERS
    return False


@cache
def _find(name: str) -> ModuleSpec | None:
    """Where a module is, looked up without running the packages that it is in."""
    package, _, _ = name.rpartition(".")
    if package:
        spec = _find(package)
        folders = None if spec is None else spec.submodule_search_locations
        return None if folders is None else PathFinder.find_spec(name, folders)
    try:
        return importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None


@cache
def _module_names(package: str) -> frozenset[str]:
    """Full names of the modules inside a package; none if it is a plain module."""
    spec = _find(package)
    folders = spec.submodule_search_locations if spec else None
    paths = [path for folder in folders or () for path in Path(folder).iterdir()]
    return frozenset(f"{package}.{path.stem}" for path in paths if path.suffix in ("", ".py"))


# What a process remembers of sources, for who changes them while it runs.
CACHES = (_hash, _read_source, _module_names, _neighbours, _find)
