"""Whether what a `SampledModel` is made of goes together."""

from __future__ import annotations

from typing import Any

import numpy as np

_POSITIVE = ("dt", "temperature", "samples", "substeps", "restarts", "tolerance", "replicates")
_COUNTS = ("samples", "substeps", "restarts", "seed", "replicates")


def check_model(model: Any) -> None:
    """Raise where it does not.

    Raises:
        ValueError: see `SampledModel`.
    """
    for name in _POSITIVE:
        if not getattr(model, name) > 0:
            raise ValueError(f"SampledModel.{name} must be positive: {getattr(model, name)}")
    for name in _COUNTS:
        number = getattr(model, name)
        if not isinstance(number, int | np.integer) or number < 0:
            raise ValueError(f"SampledModel.{name} must be a whole number from 0 on: {number}")
    for name in ("dt", "temperature"):
        if not np.isfinite(getattr(model, name)):
            raise ValueError(f"SampledModel.{name} must be finite: {getattr(model, name)}")
    dimension, space = model.regions.space.dimension, model.system.space
    if dimension != space.dimension:
        raise ValueError(
            f"regions of {dimension} dimensions do not fit a state space of {space.dimension}"
        )
    controls, limit = model.system.control_box.dimension, model.limit
    if limit is not None and (limit.dimension != controls or not np.all(limit.widths > 0)):
        raise ValueError(
            f"SampledModel.limit needs a range above 0 of each of {controls} controls, not {limit}"
        )
