"""Plain nested values: from dataclasses, as canonical JSON, and flat by dotted key."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any


def canonical_json(value: Any) -> bytes:
    """One spelling for equal values: sorted keys, shortest exact numbers, no spaces.

    Raises:
        TypeError: something that is neither a dataclass nor JSON, such as an array.
        ValueError: NaN or infinity.
    """
    text = json.dumps(plain(value), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.encode()


def flatten(tree: Any, prefix: str = "") -> dict[str, Any]:
    """Scalars by dotted key, in order; a list is one value, spelt as JSON."""
    if not isinstance(tree, dict):
        return {prefix: json.dumps(tree) if isinstance(tree, list) else tree}
    flat = {}
    for key, value in tree.items():
        flat.update(flatten(value, f"{prefix}.{key}" if prefix else key))
    return flat


def plain(value: Any) -> Any:
    """Dataclasses, mappings and tuples as dicts and lists, ready for JSON."""
    if isinstance(value, str | int | float | None):  # most values are: no other question of them
        return value
    if dataclasses.is_dataclass(value):
        fields = dataclasses.fields(value)
        return {field.name: plain(getattr(value, field.name)) for field in fields}
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return value
