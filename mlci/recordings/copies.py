"""Copies of one recording, which are one piece of evidence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlci.demonstrations import Demonstration
from mlci.spaces import StateSpace

_SAME = 1e-6  # of the bounds' widths, and of the duration


def distinct(
    demonstrations: Sequence[Demonstration], space: StateSpace
) -> tuple[list[Demonstration], list[tuple[str, str]]]:
    """The demonstrations without copies, and for each copy its name and that of the original.

    Copies have the same samples at the same times, but for rounding and whole turns: two paths of a
    living being never do.
    """
    kept: list[Demonstration] = []
    copies = []
    starts = np.array([each.states[0] for each in demonstrations]).reshape(-1, space.dimension)
    first: list[int] = []  # numbers of those that are kept
    for number, demonstration in enumerate(demonstrations):
        apart = np.abs(space.difference(starts[first], starts[number]))
        near = np.flatnonzero(np.all(apart <= _SAME * space.bounds.widths, axis=1))
        original = next((kept[i] for i in near if _is_copy(demonstration, kept[i], space)), None)
        if original is None:
            kept.append(demonstration)
            first.append(number)
        else:
            copies.append((demonstration.name, original.name))
    return kept, copies


def _is_copy(one: Demonstration, other: Demonstration, space: StateSpace) -> bool:
    """Whether two demonstrations are the same but for rounding."""
    if one.states.shape != other.states.shape:
        return False
    apart = np.abs(space.difference(one.states, other.states))
    return bool(
        np.all(np.abs(one.times - other.times) <= _SAME * one.times[-1])
        and np.all(apart <= _SAME * space.bounds.widths)
    )
