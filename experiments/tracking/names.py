"""Names that are read from files, and the paths that are made of them.

A folder of results may come from anybody. Whatever one of its files names must be a plain name,
and what is below the folder must be a file or a folder of its own, not a link.
"""

from __future__ import annotations

import errno
import re
from pathlib import Path

_NAME = re.compile(r"[\w-][\w.-]*")
_IDENTITY = re.compile("[0-9a-f]{32}")
_DIGEST = re.compile("[0-9a-f]{64}")


class UnsafePath(OSError):
    """A name that leads out of the folder that it should be in; the message says how."""

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(errno.EINVAL, reason, str(path))


def is_name(value: object) -> bool:
    """Whether something names one file or folder: letters, digits and `._-`, no dot first."""
    return isinstance(value, str) and bool(_NAME.fullmatch(value))


def is_identity(value: object) -> bool:
    """Whether something is the identity of a point, or the key of a stored stage."""
    return isinstance(value, str) and bool(_IDENTITY.fullmatch(value))


def is_digest(value: object) -> bool:
    """Whether something is a sha256 in hexadecimal."""
    return isinstance(value, str) and bool(_DIGEST.fullmatch(value))


def inner_path(folder: Path, *names: str) -> Path:
    """The path of names below a folder, which itself may be a link.

    Raises:
        UnsafePath: a name is none, or something on the way is a link.
    """
    path = folder
    for name in names:
        path = path / name
        if not is_name(name):
            raise UnsafePath(path, "is no plain name: letters, digits and ._-, no dot first")
        if path.is_symlink():
            raise UnsafePath(path, "is a link; results are files and folders of their own")
    return path
