"""JSON files that carry their own digest, so that no change of a character goes unnoticed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.tracking.files import digest, read_file, replace_file

_KEY = "digest"


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
    data = read_file(path)
    try:
        content: Any = json.loads(data)
        content.pop(_KEY)
        if _sealed(content) == data:
            return dict(content)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        pass
    raise SealError(f"{path} is not as it was written: it does not match its digest")


def _sealed(content: Mapping[str, Any]) -> bytes:
    """A tree as JSON, its digest the last key."""
    text = json.dumps(content, indent=1, allow_nan=False)
    whole = {**content, _KEY: digest(text.encode())}
    return json.dumps(whole, indent=1, allow_nan=False).encode() + b"\n"
