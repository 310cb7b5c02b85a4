"""States outside the state space: clipped where that may be rounding, refused where it is not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mlci.spaces import Floats, StateSpace

_ROUNDING = 1e-4  # of the bounds' width
_MOST_TURNS = 1e6  # of a periodic dimension
_IN_DEGREES = 180 / np.pi
_FAR = 3.0  # times the bounds: what is beyond them by less is rather wide than in degrees


def clip_rounding(
    states: Floats, space: StateSpace, place: Callable[[int, str], str]
) -> tuple[Floats, str]:
    """States within the bounds, and what was done for that, or "".

    Args:
        states: (K+1, n) states.
        space: whose bounds hold in dimensions that are not periodic.
        place: names a sample and a dimension in a message.

    Raises:
        ValueError: a state that is not finite, or outside by more than 0.0001 of the bounds' width.
    """
    if not np.all(np.isfinite(states)):
        sample, d = (int(i) for i in np.argwhere(~np.isfinite(states))[0])
        raise ValueError(
            f"{place(sample, space.names[d])}: {space.names[d]} = {states[sample, d]:g} is not a "
            "finite number"
        )
    turns = np.where(space.periodic, np.abs(states) / space.bounds.widths, 0.0)
    if np.any(turns > _MOST_TURNS):
        sample, d = (int(i) for i in np.argwhere(turns > _MOST_TURNS)[0])
        raise ValueError(
            f"{place(sample, space.names[d])}: {space.names[d]} = {states[sample, d]:g} is more "
            f"than {_MOST_TURNS:g} turns away, which leaves no digits for where it is"
        )
    lower = np.where(space.periodic, -np.inf, space.bounds.lower)
    upper = np.where(space.periodic, np.inf, space.bounds.upper)
    clipped = np.clip(states, lower, upper)
    beyond = np.abs(states - clipped) / space.bounds.widths
    if np.any(beyond > _ROUNDING):
        sample, d = (int(i) for i in np.argwhere(beyond > _ROUNDING)[0])
        name, outside = space.names[d], int(np.sum(np.any(beyond > _ROUNDING, axis=1)))
        farthest = states[int(np.argmax(beyond[:, d])), d]
        bounds = space.bounds.lower[d], space.bounds.upper[d]
        far = abs(farthest) > _FAR * np.max(np.abs(bounds))
        inside = bounds[0] <= farthest / _IN_DEGREES <= bounds[1]
        advice = "widen its bounds, or leave the file out"
        if "rad" in space.units[d] and far and inside:
            unit = space.units[d].replace("rad", "deg")
            advice = f"is it in degrees? then units={{{name}: {unit}}}; else {advice}"
        raise ValueError(
            f"{place(sample, name)}: {name} = {states[sample, d]:g} is outside the state space "
            f"(bounds {bounds[0]:g} to {bounds[1]:g}; {outside} of "
            f"{len(states)} samples): {advice}"
        )
    count = int(np.sum(np.any(beyond > 0, axis=1)))
    note = f"{count} samples are outside the state space by rounding, and are clipped to it"
    return clipped, note if count else ""
