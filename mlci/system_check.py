"""Whether a system keeps the promises of `System`: tried at a few states, before any work."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System, central_differences, reward_differences

_STATES, _CONTROLS = 7, 5  # that no system is likely to have as dimensions
_TRIED = _STATES * _CONTROLS  # states and controls at which a control's effect is tried
_TOLERANCE = 1e-4  # of a derivative, relative to its largest entry or 1
_BENT = 1e-7  # of a rate's largest value or 1 that affine dynamics may be off by rounding


def check_system(system: System) -> None:
    """Call a system's functions with states (7, 1, n) and controls (5, m) drawn inside its boxes.

    Raises:
        ValueError: it is no system; the message names the function at fault, shows the shapes or
            values, and says what to do.
    """
    name = type(system).__name__
    space = _boundary(system, "space", StateSpace)
    box = _boundary(system, "control_box", Box)
    if len(set(space.names)) < space.dimension or not all(map(str.isidentifier, space.names)):
        raise ValueError(f"{name}.space: names must be words, each once, not {space.names}")
    if not np.all(np.isfinite(box.widths) & (box.widths > 0)):
        raise ValueError(
            f"{name}.control_box must be finite and not empty: {box.lower} to {box.upper}"
        )
    rng = np.random.default_rng(0)
    states = rng.uniform(space.bounds.lower, space.bounds.upper, (_STATES, 1, space.dimension))
    controls = rng.uniform(box.lower, box.upper, (_CONTROLS, box.dimension))
    for array in (states, controls):
        array.flags.writeable = False
    batch, n = (_STATES, _CONTROLS), space.dimension

    def reward(x: Floats, u: Floats) -> Any:
        """It may depend on one of the two only."""
        batch = np.broadcast_shapes(x.shape[:-1], u.shape[:-1])
        return np.broadcast_to(system.running_reward(x, u), batch)

    with np.errstate(all="ignore"):
        _check_function(name, "dynamics", system.dynamics, (*batch, n), states, controls)
        _check_function(name, "running_reward", reward, batch, states, controls)
        for method, differences, parts in (
            ("jacobians", central_differences, ("dh/dx", "dh/du")),
            ("reward_derivatives", reward_differences, ("the gradient", "the Hessian")),
        ):
            if getattr(type(system), method) is not getattr(System, method):
                expected = dict(zip(parts, differences(system, states, controls), strict=True))
                call = getattr(system, method)
                _check_derivatives(f"{name}.{method}", call, expected, states, controls)


def check_affine(system: System) -> None:
    """Try whether dynamics are affine in the control: h at a mean of controls is the mean of h.

    Only then do the corners of the control box hold the best control for safety. Inference does
    without. Tried at 35 states and pairs of controls drawn inside the boxes.

    Raises:
        ValueError: dynamics that are not affine in the control.
    """
    space, box = system.space, system.control_box
    rng = np.random.default_rng(0)
    states = rng.uniform(space.bounds.lower, space.bounds.upper, (_TRIED, space.dimension))
    one, other = rng.uniform(box.lower, box.upper, (2, _TRIED, box.dimension))
    share = rng.uniform(0.2, 0.8, (_TRIED, 1))
    between = share * one + (1 - share) * other
    rates = system.dynamics(states, between)
    ends = system.dynamics(states, one), system.dynamics(states, other)
    mean = share * ends[0] + (1 - share) * ends[1]
    off = np.abs(rates - mean) - _BENT * np.maximum(1.0, np.max(np.abs(ends), axis=(0, 1)))
    if np.any(off > 0):
        i, d = np.unravel_index(int(np.argmax(off)), off.shape)
        raise ValueError(
            f"{type(system).__name__}.dynamics is not affine in the control, so that the corners "
            f"of its box need not hold the safest one: the rate of {space.names[d]} is "
            f"{rates[i, d]:.4g} at {_place(states[i], between[i])}, and "
            f"{ends[0][i, d]:.4g} and {ends[1][i, d]:.4g} at controls {_numbers(one[i])} "
            f"and {_numbers(other[i])}, on both sides of it, which makes {mean[i, d]:.4g}; take "
            "what enters the rates, such as a force, as the control"
        )


def _boundary(system: System, attribute: str, kind: type[Any]) -> Any:
    """The state space or the control box."""
    where = f"{type(system).__name__}.{attribute}"
    try:
        found = getattr(system, attribute)
    except Exception as error:
        raise ValueError(f"{where} fails: {_words(error)}") from None
    if not isinstance(found, kind):
        what = "a method; put @property above it" if callable(found) else _sort(found)
        raise ValueError(f"{where} must be a {kind.__name__}, not {what}")
    return found


def _check_function(
    name: str,
    function: str,
    call: Callable[[Floats, Floats], Any],
    shape: tuple[int, ...],
    states: Floats,
    controls: Floats,
) -> None:
    """That a function of states and controls works on any leading shapes, member by member."""
    where = f"{name}.{function}"
    found = _called(where, call, states, controls)
    _check_array(where, found, shape, states, controls)
    for i, j in ((0, 0), (_STATES - 1, _CONTROLS - 1)):
        alone = _called(where, call, states[i, 0], controls[j])
        _check_array(where, alone, shape[2:], states[i, 0], controls[j])
        if not np.allclose(found[i, j], alone, rtol=1e-9, atol=1e-12):
            raise ValueError(
                f"{where} mixes the members of a batch: at {_place(states[i, 0], controls[j])} it "
                f"is {_numbers(found[i, j])} among others and {_numbers(alone)} alone"
            )


def _check_derivatives(
    where: str,
    call: Callable[[Floats, Floats], Any],
    expected: dict[str, Floats],
    states: Floats,
    controls: Floats,
) -> None:
    """That two arrays of derivatives have the shapes of differences and agree with them."""
    result = _called(where, call, states, controls)
    if not (isinstance(result, tuple) and len(result) == len(expected)):
        raise ValueError(
            f"{where} must be two arrays, {' and '.join(expected)}, not {_sort(result)}"
        )
    for (part, differences), array in zip(expected.items(), result, strict=True):
        _check_array(f"{where}: {part}", array, differences.shape, states, controls)
        error = np.abs(array - differences)
        error -= _TOLERANCE * np.max(np.abs(differences), initial=1.0)
        if np.any(error > 0):
            at = np.unravel_index(int(np.argmax(error)), error.shape)
            i, j, *entry = at
            raise ValueError(
                f"{where}: {part}[{', '.join(map(str, entry))}] is {array[at]:.6g} where "
                f"differences give {differences[at]:.6g}, at {_place(states[i, 0], controls[j])}; "
                f"mend it, or leave {where.partition('.')[2]} out"
            )


def _called(where: str, call: Callable[[Floats, Floats], Any], x: Floats, u: Floats) -> Any:
    """What a function returns."""
    try:
        return call(x, u)
    except Exception as error:
        raise ValueError(
            f"{where} fails for states {x.shape} and controls {u.shape}: {_words(error)}; their "
            "leading shapes are any that broadcast, so take states[..., 0] and controls[..., 0], "
            "and end with np.stack(np.broadcast_arrays(first, second), axis=-1)"
        ) from None


def _check_array(where: str, found: Any, shape: tuple[int, ...], x: Floats, u: Floats) -> None:
    """That a result is an array of finite numbers of the right shape."""
    of = f"for states {x.shape} and controls {u.shape}"
    if not isinstance(found, np.ndarray | np.generic) or found.dtype.kind not in "fiu":
        raise ValueError(f"{where} must be an array of real numbers {of}, not {_sort(found)}")
    found = np.asarray(found)
    if found.shape != shape:
        raise ValueError(
            f"{where} must be {shape} {of}, not {found.shape}: leading shapes broadcast, and the "
            "system's own dimensions come last"
        )
    if not np.all(np.isfinite(found)):
        if x.ndim == 3:  # a batch: of its members the first that is wrong
            i, j = np.argwhere(~np.isfinite(found))[0][:2]
            found, x, u = found[i, j], x[i, 0], u[j]
        raise ValueError(f"{where} is {_numbers(found)} at {_place(x, u)}; it must be finite")


def _place(state: Floats, control: Floats) -> str:
    """Where something was found."""
    return f"state {_numbers(state)} and control {_numbers(control)}"


def _numbers(values: Any) -> str:
    """Numbers, short."""
    return np.array2string(np.asarray(values), precision=4, separator=", ")


def _words(error: Exception) -> str:
    """Type and message of an error, on one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def _sort(found: Any) -> str:
    """What something is, in a word."""
    kind = type(found).__name__
    return f"{kind} of {found.dtype}" if isinstance(found, np.ndarray) else kind
