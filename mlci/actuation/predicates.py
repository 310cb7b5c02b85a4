"""Hypotheses about controls that functions describe: "pushes right while moving right"."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mlci.actuation.hypotheses import ControlHypotheses
from mlci.spaces import Bools, Floats
from mlci.systems import System

PairFunction = Callable[[Floats, Floats], ArrayLike]

_PAIRS = 4096  # random pairs that a function is tried at


@dataclass(frozen=True, eq=False)
class ControlPredicates(ControlHypotheses):
    """C hypotheses, each of which forbids the pairs for which a function says yes.

    Attributes:
        functions: (C,) of states (..., n), wrapped, and controls (..., m); each returns truth
            values (...,), or levels, which are below 0 where it is forbidden.
        names: (C,) name of each, all different; by default that of its function.

    Raises:
        ValueError: something that is no function, or names that are too few, too many or not
            different.
    """

    functions: Sequence[PairFunction]
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        functions = tuple(self.functions) if isinstance(self.functions, Sequence) else None
        for each in (self.functions,) if functions is None else functions:
            if functions is None or not callable(each):
                raise ValueError(
                    f"control predicates need a list of functions of states and controls, not "
                    f"{each!r}"
                )
        assert functions is not None
        names = tuple(self.names) or tuple(
            str(getattr(each, "__name__", number)) for number, each in enumerate(functions)
        )
        if len(names) != len(functions) or len(set(names)) < len(names):
            raise ValueError(
                f"{len(functions)} functions need as many different names, not {list(names)}"
            )
        object.__setattr__(self, "functions", functions)
        object.__setattr__(self, "names", names)

    def check(self, system: System) -> None:
        """See `ControlHypotheses.check`: shapes and numbers that they return, at random pairs, and
        that they return the same again."""
        rng, bounds, box = np.random.default_rng(0), system.space.bounds, system.control_box
        states = rng.uniform(bounds.lower, bounds.upper, (_PAIRS, bounds.dimension))
        controls = rng.uniform(box.lower, box.upper, (_PAIRS, box.dimension))
        for name, function in zip(self.names, self.functions, strict=True):
            try:
                values = np.asarray(function(states, controls))
            except Exception as error:  # it may be anybody's function
                raise ValueError(
                    f"control predicate {name} fails for states {states.shape} and controls "
                    f"{controls.shape}: {type(error).__name__}: {error}"
                ) from error
            if values.shape != (_PAIRS,) or values.dtype.kind not in "bif":
                raise ValueError(
                    f"control predicate {name} must return a truth value or a level a pair, of "
                    f"shape ({_PAIRS},) for states {states.shape} and controls {controls.shape}; "
                    f"it returned {values.dtype} of shape {values.shape}"
                )
            if np.isnan(values).any():
                raise ValueError(
                    f"control predicate {name} returned NaN for states and controls within their "
                    "bounds"
                )
            if not np.array_equal(values, np.asarray(function(states, controls))):
                raise ValueError(
                    f"control predicate {name} answers differently when it is asked again: it must "
                    "depend on states and controls alone"
                )

    def holds(self, states: Floats, controls: Floats) -> Bools:
        """See `ControlHypotheses.holds`."""
        shape = np.broadcast_shapes(np.shape(states)[:-1], np.shape(controls)[:-1])
        pairs = [np.broadcast_to(part, (*shape, np.shape(part)[-1])) for part in (states, controls)]
        held = np.zeros((*shape, len(self)), dtype=bool)
        for column, (name, function) in enumerate(zip(self.names, self.functions, strict=True)):
            held[..., column] = _is_yes(name, function(*pairs), shape)
        return held


def _is_yes(name: str, answer: Any, shape: tuple[int, ...]) -> Bools:
    """Truth values as they are; levels where they are below 0.

    Raises:
        ValueError: another shape, or NaN.
    """
    values = np.asarray(answer)
    if values.shape != shape or (values.dtype.kind == "f" and np.isnan(values).any()):
        raise ValueError(
            f"control predicate {name} must return a truth value or a level a pair, of shape "
            f"{shape}; it returned {values.dtype} of shape {values.shape}"
            f"{' with NaN' if values.shape == shape else ''}"
        )
    return values if values.dtype.kind == "b" else np.asarray(values < 0)
