"""What is wrong with constraints on controls, of a truth or of hypotheses.

Each check yields a line for each fault: the key, the value and the way out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from experiments.config.settings import ControlRange, ModelSettings, Settings
from mlci.actuation.predicates import ControlPredicates
from mlci.spaces import Box, Floats
from mlci.systems import System

_STATES = 1000  # at which predicates are tried


def control_hypothesis_problems(settings: ModelSettings) -> Iterator[str]:
    """Ranges that do not match the controls, are there twice, or hold no action."""
    key, controls, system = "hypotheses.controls", settings.hypotheses.controls, settings.model
    if controls.both and not controls.is_asked:
        yield (
            f"{key}.both: {controls.both}, but nothing about controls may be forbidden; give "
            "ranges, shares or predicates, or set it to 0"
        )
    faults = list(_range_problems(f"{key}.ranges", controls.ranges, system))
    yield from faults
    if faults:
        return
    try:
        hypotheses = controls.all_ranges(system)
        _ = controls.hypotheses(system)
    except ValueError as error:
        yield f"{key}: {error}; name each once, by ranges, by shares or by predicates"
        return
    actions = settings.action_values
    held = hypotheses.holds(np.zeros((len(actions), 0)), actions)
    for i in np.flatnonzero(~np.any(held, axis=0)):
        yield (
            f"{key}: {hypotheses.names[i]} holds none of the {len(actions)} actions, so that the "
            "tabular model cannot tell; raise `actions`, or widen the range"
        )
    yield from _predicate_problems(settings, actions)


def _predicate_problems(settings: ModelSettings, actions: Floats) -> Iterator[str]:
    """Functions that fail, return something else, or forbid no action in any of many states."""
    system, bounds = settings.model, settings.model.space.bounds
    rng = np.random.default_rng(0)
    states = rng.uniform(bounds.lower, bounds.upper, (_STATES, 1, bounds.dimension))
    for number, each in enumerate(settings.hypotheses.controls.predicates):
        key = f"hypotheses.controls.predicates[{number}]"
        predicate = ControlPredicates([each.function()], (each.name,))
        try:
            predicate.check(system)
            held = predicate.holds(states, actions[None])
        except ValueError as error:
            yield f"{key}: {error}"
            continue
        if not held.any():
            yield (
                f"{key}: {each.name} forbids none of the {len(actions)} actions in any of "
                f"{_STATES} random states, so that the tabular model cannot tell; raise "
                "`actions`, or widen it"
            )


def control_truth_problems(settings: Settings) -> Iterator[str]:
    """Forbidden controls that leave no box, and what cannot be had beside them."""
    truth, key = settings.truth, "truth.controls"
    if not truth.controls:
        return
    faults = list(_range_problems(key, truth.controls, settings.model))
    yield from faults
    if not faults:
        try:
            _ = settings.control_limit
        except ValueError as error:
            ends = "; with demonstrations.clip=true the control range has ends"
            yield f"{key}: {error}{'' if settings.demonstrations.clip else ends}"
    if not faults and (truth.count or truth.cell is not None):
        try:
            _ = settings.limited_model
        except ValueError as error:
            yield f"{key}: {error}"


def _range_problems(key: str, listed: tuple[ControlRange, ...], system: System) -> Iterator[str]:
    """Ranges that do not match the controls of a system."""
    box = system.control_box
    for i, each in enumerate(listed):
        for name in ("lower", "upper"):
            ends = getattr(each, name)
            if len(ends) != box.dimension:
                yield (
                    f"{key}[{i}].{name}: {list(ends)} must have {box.dimension} entries, one a "
                    "control, null where there is no end"
                )
        if not len(each.lower) == len(each.upper) == box.dimension:
            continue
        if all(end is None for end in (*each.lower, *each.upper)):
            yield f"{key}[{i}]: holds every control; give it an end"
        elif key.startswith("hypotheses") and _holds_all(each.lower, each.upper, box):
            yield (
                f"{key}[{i}]: holds every control from {box.lower.tolist()} to "
                f"{box.upper.tolist()}; give it an end inside"
            )
        for k, (low, high) in enumerate(zip(each.lower, each.upper, strict=True)):
            first, last = box.lower[k], box.upper[k]
            if low is not None and high is not None and low >= high:
                yield f"{key}[{i}]: control {k} from {low} to {high}; lower must be below upper"
            elif (low is not None and low >= last) or (high is not None and high <= first):
                yield (
                    f"{key}[{i}]: holds nothing of control {k}, which goes from {first:g} to "
                    f"{last:g}; move the range inside"
                )
    if len({(each.lower, each.upper) for each in listed}) < len(listed):
        yield f"{key}: a range is given twice; name each once"


def _holds_all(lower: Sequence[float | None], upper: Sequence[float | None], box: Box) -> bool:
    """Whether an open range holds a whole box."""
    return all(
        (low is None or low < first) and (high is None or high > last)
        for low, high, first, last in zip(lower, upper, box.lower, box.upper, strict=True)
    )
