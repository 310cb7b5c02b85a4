"""Numbers as JSON has them: none is infinite."""

from __future__ import annotations

import math


def finite(number: float) -> float | None:
    """The number, or None if it is infinite or nan."""
    return float(number) if math.isfinite(number) else None
