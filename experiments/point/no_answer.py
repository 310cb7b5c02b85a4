"""Why a point has no answer, in numbers."""

from __future__ import annotations

import numpy as np

from mlci.demonstrator import Outcome
from mlci.spaces import Floats, StateSpace


class NoAnswer(RuntimeError):
    """A point that has no answer, such as one that keeps no demonstration.

    The message has the numbers, and what to change: where it was raised tells nobody more.
    """


def why_none(
    outcome: np.ndarray, states: Floats, miss: Floats, space: StateSpace, tolerance: float
) -> str:
    """Why no trial was kept: how many for each reason, and which came nearest to being kept.

    Args:
        outcome: (P,) `Outcome` values, none of them kept.
        states: (P, K+1, n) paths.
        miss: (P,) final distances to the goal.
        space: of the states.
        tolerance: largest distance to the goal.
    """
    left, missed = (
        np.flatnonzero(outcome == kind.value) for kind in (Outcome.BOUNDS_LEFT, Outcome.GOAL_MISSED)
    )
    nearest = ["", ""]
    if len(left):
        lower, upper = space.bounds.lower, space.bounds.upper
        beyond = np.maximum(lower - states[left], states[left] - upper).max(axis=1)  # (P, n)
        beyond = np.where(space.periodic, -np.inf, beyond)
        least = int(np.argmin(beyond.max(axis=1)))
        d = int(np.argmax(beyond[least]))
        bounds = f"{lower[d]:g} to {upper[d]:g} {space.units[d]}".rstrip()
        nearest[0] = (
            f" (trial {left[least]} the least, {space.names[d]} by {beyond[least, d]:.3g} beyond "
            f"{bounds})"
        )
    if len(missed):
        trial = missed[np.argmin(miss[missed])]
        nearest[1] = (
            f" (trial {trial} the least, by {miss[trial]:.3g}; demonstrations.goal_tolerance is "
            f"{tolerance:g})"
        )
    entered = np.sum(outcome == Outcome.TRUTH_ENTERED.value)
    return (
        f"of {len(outcome)} trials {entered} entered the truth, {len(left)} left the state "
        f"space{nearest[0]}, {len(missed)} missed the goal{nearest[1]}"
    )
