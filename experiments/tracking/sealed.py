"""JSON files that carry their own digest, so that no change of a character goes unnoticed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.tracking.files import digest, read_file, replace_file

_END, _SEAL = b"\n}", b',\n "digest": '


class SealError(ValueError):
    """A file that is not as it was written; the message names it."""


def write_sealed(path: Path, content: Mapping[str, Any]) -> None:
    """Write a tree as JSON, with its digest.

    Raises:
        ValueError: NaN or infinity.
    """
    replace_file(path, _sealed(content))


def read_sealed(path: Path) -> dict[str, Any]:
    """The tree of a file that `write_sealed` wrote, without its digest.

    Raises:
        OSError: the file cannot be read.
        SealError: it is not as it was written.
    """
    # The text itself is compared: to spell it again takes ten times as long.
    text, _, seal = read_file(path).rpartition(_SEAL)
    text += _END
    try:
        content: Any = json.loads(text)
        if seal == _seal(text) and isinstance(content, dict):
            return content
    except (ValueError, RecursionError):
        pass
    raise SealError(f"{path} is not as it was written: it does not match its digest")


def _sealed(content: Mapping[str, Any]) -> bytes:
    """A tree, which is not empty, as JSON, its digest the last key."""
    text = json.dumps(content, indent=1, allow_nan=False).encode()
    return text.removesuffix(_END) + _SEAL + _seal(text)


def _seal(text: bytes) -> bytes:
    """What closes a file whose text without the digest is `text`."""
    return f'"{digest(text)}"\n}}\n'.encode()
