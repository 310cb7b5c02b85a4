"""What was read of source files before, so that each is parsed once and not by every process.

A file is known again as git knows files: by its size, the times of its last change, and its inode.
No change of a file leaves all of them as they are, but one within a step of its file system's
clock. So a file is remembered only if it is older than that when it is read.

The memory lies with Python's bytecode of the module that reads, in `__pycache__`. Whoever can write
there decides what code runs here, so that a false memory gains nobody anything. Where nobody can
write, or is not to (PYTHONDONTWRITEBYTECODE), there is none, and files are read.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

from experiments.tracking.files import (
    digest,
    file_stamp,
    is_settled,
    read_file,
    replace_file,
)


class SourceMemory:
    """What one module reads of files, as plain values by their paths.

    Attributes:
        path: where it is kept.
    """

    def __init__(self, reader: str) -> None:
        """The memory of the module that is being imported from the file `reader`.

        Once that changes, all is forgotten, as it may read otherwise.
        """
        self.path = Path(cache_from_source(reader)).with_suffix(".json")
        self._reader = file_stamp(reader)
        self._is_sure = is_settled(self._reader)
        self._is_new = False

    def recall(self, path: str, read: Callable[[str], Any]) -> Any:
        """What `read` says of a file; it is asked only if the file is new or has changed."""
        stamp = file_stamp(path)
        lasts = self._is_sure and is_settled(stamp)
        before, value = self._known.get(path, (None, None))
        if before != stamp:
            value = read(path)
            if lasts:
                self._known[path] = [stamp, value]
                self._is_new = True
        return value

    def save(self) -> None:
        """Write what is new, if that is possible."""
        if self._is_new and not sys.dont_write_bytecode:
            text = json.dumps([self._reader, self._known])
            with suppress(OSError):
                replace_file(self.path, f"{digest(text.encode())}\n{text}".encode())
        self._is_new = False

    @cached_property
    def _known(self) -> dict[str, list[Any]]:
        """Stamp and value of each file; none of a memory that is damaged, or another reader's."""
        try:
            seal, _, text = read_file(self.path).partition(b"\n")
            if self._is_sure and seal == digest(text).encode():
                reader, known = json.loads(text)
                if reader == self._reader:
                    return dict(known)
        except (OSError, ValueError):
            pass
        return {}
