"""Modules of the current folder, which a user's own config may name.

The folder is no place to look for anything else: it may be a download, and a file of the name of an
optional package, such as numexpr.py, would run as soon as somebody looks for that package.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


def put_on_path(module: str) -> None:
    """Have a module, and what it imports from beside it, found in the current folder.

    The folder stays out of the path unless the module is there and nowhere else. It comes last, so
    that it hides nothing.

    Args:
        module: its full name.
    """
    if _is_own(module):
        sys.path.append(os.getcwd())


@contextmanager
def on_path(module: str) -> Iterator[None]:
    """The same while a block runs, which reads its source and runs none of it."""
    before = list(sys.path)
    put_on_path(module)
    try:
        yield
    finally:
        sys.path[:] = before


def _is_own(module: str) -> bool:
    """Whether a module is in the current folder, and nowhere else."""
    top = module.partition(".")[0]
    if not top.isidentifier() or top in sys.modules:
        return False
    return (os.path.isfile(f"{top}.py") or os.path.isdir(top)) and not importlib.util.find_spec(top)
