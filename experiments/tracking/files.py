"""The one way to read and to write a file of results; digests.

Whatever happens while it is written, a file is the old one or the new one. Files of results may
come from anybody, so only regular files are read: no link, which could lead anywhere, and no pipe,
which could keep a reader waiting for ever.
"""

from __future__ import annotations

import ctypes
import errno
import hashlib
import json
import os
import secrets
import stat
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any, BinaryIO, TextIO

if TYPE_CHECKING:
    import pandas as pd

PART = ".part"  # the end of the names of files that are being written

_EXCHANGE, _HERE = 2, -100  # RENAME_EXCHANGE and AT_FDCWD of Linux
_STEP = 2_000_000_000  # [ns] the coarsest that a file system's clock has: that of FAT

_digests: dict[str, tuple[list[int], str]] = {}  # stamps and digests of files, in this process


def make_writable(folder: Path) -> None:
    """Make a folder if need be, and see that a file can be written there.

    Raises:
        OSError: none can.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryFile(dir=folder):
        pass


def digest(data: bytes) -> str:
    """sha256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def file_digest(path: Path) -> str:
    """sha256 of a regular file, which is read again only where it may have changed.

    Raises:
        OSError: as of `read_file`.
    """
    stamp = file_stamp(path, follow_symlinks=False)
    before, value = _digests.get(str(path), (None, ""))
    if before != stamp:
        value = digest(read_file(path))
        if is_settled(stamp):
            _digests[str(path)] = stamp, value
    return value


def file_stamp(path: Path | str, *, follow_symlinks: bool = True) -> list[int]:
    """What changes with a file, as git knows files: size, times of last change, and inode.

    No change of a file leaves all of them as they are, but one within a step of its file system's
    clock: see `is_settled`.
    """
    status = os.stat(path, follow_symlinks=follow_symlinks)
    return [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]


def is_settled(stamp: list[int]) -> bool:
    """Whether a change of the file from now on gives it another stamp."""
    _, modified, changed, _ = stamp
    return time.time_ns() - max(modified, changed) > _STEP


def read_file(path: Path) -> bytes:
    """The content of a regular file.

    Raises:
        OSError: there is no such file, or it is a link, a pipe or a folder.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "is a link, which is not followed", str(path)) from None
        raise
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise OSError(errno.EINVAL, "is no regular file", str(path))
    with open(handle, "rb") as file:
        return file.read()


def replace_file(path: Path, data: bytes, readers: int = 0o777) -> None:
    """Write a file so that, whatever happens, it is the old one or the new one.

    Args:
        path: the file.
        data: its content.
        readers: bits of the mode that it may have at most, where the umask allows more.
    """
    with replacing(path) as file:
        os.fchmod(file.fileno(), stat.S_IMODE(os.fstat(file.fileno()).st_mode) & readers)
        file.write(data)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write; it takes the place of the old one when the block ends, all of it on disk.

    Its attribute `name` is its path until then. Who may read it is up to the umask.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    name = part_of(path)
    try:
        with open(name, "xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(name, path)
        _sync_folder(path.parent)
    except BaseException:
        with suppress(FileNotFoundError):
            os.unlink(name)
        raise


@contextmanager
def growing(path: Path) -> Iterator[TextIO]:
    """A new file for a log, line by line on disk while its process runs; an old one is removed."""
    path.unlink(missing_ok=True)  # never written into: it may be a link
    with open(path, "x", buffering=1, encoding="utf-8", errors="backslashreplace") as file:
        yield file


def part_of(path: Path) -> Path:
    """A new name beside a file or folder, for what takes its place once it is whole."""
    return path.with_name(f".{path.name[:200]}-{secrets.token_hex(4)}{PART}")


def exchange_folders(new: Path, old: Path) -> None:
    """Let two folders of one parent change names, at once where the system can (Linux).

    Elsewhere there is a moment without the old name. If there is no old folder, the new one takes
    its name.
    """
    try:
        os.rename(new, old)  # works where there is none, or an empty one
    except OSError as error:
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
            raise
        if not _exchanged(new, old):
            aside = part_of(old)
            os.rename(old, aside)
            os.rename(new, old)
            os.rename(aside, new)
    _sync_folder(old.parent)


def csv_bytes(frame: pd.DataFrame, *, header: bool = True) -> bytes:
    """A table as CSV, floats exact; without its header, the rows alone."""
    text: str = frame.to_csv(index=False, header=header, lineterminator="\n")
    return text.encode()


def json_bytes(tree: Mapping[str, Any]) -> bytes:
    """A tree as JSON for people and programs, a key a line."""
    return json.dumps(tree, indent=1, allow_nan=False).encode() + b"\n"


def _exchanged(one: Path, other: Path) -> bool:
    """Let two paths change names in one step; False where system or file system cannot."""
    rename = getattr(ctypes.CDLL(None), "renameat2", None)
    if rename is None:
        return False
    status: int = rename(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _EXCHANGE)
    return status == 0


def _sync_folder(folder: Path) -> None:
    """Have the names in a folder on disk, where its file system can do that for folders."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(handle)
