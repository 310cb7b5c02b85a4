"""Whether what a `SampledModel` is made of goes together."""

from __future__ import annotations

from typing import Any

import numpy as np

from mlci.spaces import Box
from mlci.systems import System

_POSITIVE = ("dt", "temperature", "samples", "substeps", "restarts", "tolerance", "replicates")
_POINTS = 100  # at which a reward is looked at
_CURVED = 1e-6  # second derivative of a reward by the controls, below which there is none
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
    _check_reward(model.system, limit)


def _check_reward(system: System, limit: Box | None) -> None:
    """Raise where a reward has no expansion from which paths can be proposed.

    Corners of it, and walls where it is -inf, do no harm: weights know of them.
    """
    rng, space, box = np.random.default_rng(0), system.space, system.control_box
    states = rng.uniform(space.bounds.lower, space.bounds.upper, (_POINTS, space.dimension))
    controls = rng.uniform(box.lower, box.upper, (_POINTS, box.dimension))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        reward = np.broadcast_to(system.running_reward(states, controls), (_POINTS,))
        _, hessian = system.reward_derivatives(states, controls)
    name = type(system).__name__
    if not np.all(reward < np.inf):
        at = np.argmax(~(reward < np.inf))
        raise ValueError(
            f"{name}.running_reward is {reward[at]} at state {states[at].tolist()} and control "
            f"{controls[at].tolist()}: it must be a number, or -inf where nothing may be"
        )
    if limit is not None:
        return  # then paths need not be dear by their controls
    of_controls = hessian[..., space.dimension :, space.dimension :]
    finite = np.isfinite(of_controls).all(axis=(-2, -1))
    least = np.min(np.linalg.eigvalsh(-of_controls[finite]), axis=-1)
    if not np.any(least > _CURVED):
        raise ValueError(
            f"{name}.running_reward has no expansion that paths can be drawn from: nowhere does it "
            "bend down in all directions of the controls, as -|u|^2 does; set a limit of the "
            "controls, or round off what has a corner"
        )
