"""The source code that a result depends on, as a hash."""

from __future__ import annotations

import ast
import importlib.util
import os
from collections.abc import Iterable
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from experiments.tracking.files import digest
from experiments.tracking.trees import canonical_json

# Imports from these packages count wherever they occur; of all other packages none does.
_PROJECT = ("experiments", "mlci", "paper_figures")


def source_hash(modules: Iterable[str]) -> str:
    """Hash of the source of some modules and of all that they import, directly or not.

    Imports count from this project and from the packages of the modules themselves; for a module
    in no package, from the modules and packages in its folder. Sources are read, never run: a name
    may come from a file of results.
    """
    sources: dict[str, str] = {}
    waiting = list(modules)
    packages = {name.partition(".")[0] for name in waiting}.union(_PROJECT)
    packages.update(*(_neighbours(name) for name in waiting if "." not in name))
    while waiting:
        name = waiting.pop()
        if name not in sources:
            sources[name], imported = _read_source(name)
            waiting += [other for other in imported if other.partition(".")[0] in packages]
    return digest(canonical_json(sources))


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
    data = Path(spec.origin).read_bytes()
    imported: list[str] = []
    for node in ast.walk(ast.parse(data)):
        if isinstance(node, ast.Import):
            imported += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = "." * node.level + (node.module or "")
            origin = importlib.util.resolve_name(start, spec.parent)
            imported.append(origin)
            # `from package import module` names a module only if it is one.
            inner = [f"{origin}.{alias.name}" for alias in node.names]
            imported += [other for other in inner if other in _module_names(origin)]
    return digest(data), tuple(imported)


def _find(name: str) -> ModuleSpec | None:
    """Where a module is, looked up without running the packages that it is in."""
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
