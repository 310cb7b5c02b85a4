"""How much memory the arrays of an object take."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from scipy import sparse


def held_bytes(what: Any) -> int:
    """Bytes of all arrays that an object holds, those of its cached properties included."""
    if isinstance(what, np.ndarray):
        return what.nbytes
    if sparse.issparse(what):
        return int(what.data.nbytes + what.indices.nbytes + what.indptr.nbytes)
    if isinstance(what, (tuple, list)):
        return sum(held_bytes(each) for each in what)
    if is_dataclass(what) and not isinstance(what, type):
        parts = {field.name: getattr(what, field.name) for field in fields(what)} | vars(what)
        return sum(held_bytes(part) for part in parts.values())
    return 0
