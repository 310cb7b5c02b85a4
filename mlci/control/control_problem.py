"""The demonstrator's optimal control problem (8): what `ilqr` minimises, for a whole batch.

Each member of a batch minimises, over the controls u_k inside a box where there is a limit,

    -sum_k r(x_k, v_k) dt + goal_weight |goal_scale excess(x_K)|^2,    x_{k+1} = step(x_k, v_k),

where r is the system's `running_reward`, `step` an integrator's step of dt, v_k = filter(x_k, u_k)
the control that a safety filter lets through, and `excess` how far the last state is outside the
goal: by the winding of periodic dimensions that is nearest to that state, or to the start. Members
never influence each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from mlci.simulate import Integrator
from mlci.spaces import Bools, Box, Floats, Ints
from mlci.systems import System


class SafeStates(Protocol):
    """States from which a filter can keep out of a truth for ever, the Omega of (10)."""

    def contains(self, states: Floats, margin: float = 0.0) -> Bools:
        """Whether states (..., n) are among them, with V at least a margin."""


class ControlFilter(Protocol):
    """What may stand between the optimised control and the system."""

    def apply(self, states: Floats, controls: Floats, ahead: Floats | None = None) -> Floats:
        """Applied controls (..., m) at states (..., n) and wanted controls (..., m).

        The optimiser knows to what states (..., n) the wanted controls lead in a time step: `ahead`
        saves a filter that looks there the step.
        """

    def clearance(self, states: Floats) -> Floats:
        """How far (...) states (..., n) may move, Euclidean, before it could change a control.

        More exactly, a control that leads no further passes. 0, where nothing is known, is safe.
        """
        return np.zeros(states.shape[:-1])

    def linearize(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        """Derivatives of the applied control: by state (..., m, n), by control (..., m, m)."""


class NoFilter(ControlFilter):
    """Every control passes."""

    def apply(self, states: Floats, controls: Floats, ahead: Floats | None = None) -> Floats:
        return controls

    def clearance(self, states: Floats) -> Floats:
        return np.full(states.shape[:-1], np.inf)

    def linearize(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        m = controls.shape[-1]
        by_state = np.zeros((*controls.shape, states.shape[-1]))
        return by_state, np.broadcast_to(np.eye(m), (*controls.shape, m))


@dataclass(frozen=True, eq=False)
class ControlProblem:
    """The problems of B members.

    Attributes:
        system: dynamics h and running reward r.
        starts: (B, n) first states.
        goal_lower: (B, n) lower corners of the goals, -inf where a dimension is free.
        goal_upper: (B, n) upper corners, +inf where free; equal to the lower ones for a point.
        dt: time step [s].
        goal_weight: price of the squared terminal error, in cost per squared unit of the state.
        safety_filter: what lets controls through.
        wind: whether any number of turns may lead to the goal; else only the winding of its middle
            that is nearest to the start, at most half a turn away.
        limit: range that controls are clipped to, before the filter; None for no limit.
        integrator: how states move on.
        goal_scale: multiplies the terminal error, or (n,) that of each dimension.
    """

    system: System
    starts: Floats
    goal_lower: Floats
    goal_upper: Floats
    dt: float
    goal_weight: float
    safety_filter: ControlFilter
    wind: bool
    limit: Box | None
    integrator: Integrator
    goal_scale: float | Floats = 1.0

    @cached_property
    def limits(self) -> tuple[Floats, Floats]:
        """(m,) least and largest controls; infinite without a limit."""
        return control_limits(self.system, self.limit)

    def of(self, members: Ints) -> ControlProblem:
        """The problems of some members only."""
        lower, upper = self.goal_lower[members], self.goal_upper[members]
        return replace(self, starts=self.starts[members], goal_lower=lower, goal_upper=upper)


@dataclass(frozen=True, eq=False)
class Paths:
    """Paths of B members, time first.

    Attributes:
        states: (K+1, B, n), not wrapped.
        wanted: (K, B, m) controls before the filter.
        applied: (K, B, m) controls after it.
        cost: (B,) cost; inf for a path that overflows.
    """

    states: Floats
    wanted: Floats
    applied: Floats
    cost: Floats

    def of(self, *index: Any) -> Paths:
        """The paths at an index into the axes behind time."""
        at = (slice(None), *index)
        return Paths(self.states[at], self.wanted[at], self.applied[at], self.cost[index])

    def put(self, members: Ints, other: Paths) -> None:
        """Overwrite the paths of some members."""
        self.states[:, members], self.wanted[:, members] = other.states, other.wanted
        self.applied[:, members], self.cost[members] = other.applied, other.cost


def check_shapes(
    system: System, starts: Floats, lower: Floats, upper: Floats, controls: Floats
) -> None:
    """Refuse shapes that disagree and goals bounded at one end only.

    Raises:
        ValueError: starts and goal corners that are not (B, n), controls that are not (B, K, m), or
            a goal side with one infinite end.
    """
    n, m = system.space.dimension, system.control_box.dimension
    shapes = starts.shape, np.shape(lower), np.shape(upper), controls.shape
    batch = (len(starts), n)
    if shapes[:3] != (batch,) * 3 or controls.ndim != 3 or controls.shape[::2] != (len(starts), m):
        raise ValueError(
            f"starts, goal corners and controls need shapes (B, {n}), (B, {n}), (B, {n}) and "
            f"(B, K, {m}), not {shapes}"
        )
    if not np.all(np.isfinite(lower) == np.isfinite(upper)):
        raise ValueError("a goal's side is bounded at both ends or at neither")


def total_cost(problem: ControlProblem, states: Floats, applied: Floats) -> Floats:
    """Cost (..., B) of states (K+1, ..., B, n) under controls (K, ..., B, m); inf for NaN."""
    reward = problem.system.running_reward(states[:-1], applied)
    running = -np.sum(np.broadcast_to(reward, applied.shape[:-1]), axis=0) * problem.dt
    excess, _ = terminal_excess(problem, states[-1])
    cost = running + problem.goal_weight * np.sum(np.square(problem.goal_scale * excess), axis=-1)
    return np.where(np.isfinite(cost), cost, np.inf)


def terminal_excess(problem: ControlProblem, states: Floats) -> tuple[Floats, Floats]:
    """How far last states (..., B, n) are outside their goals, and its derivative's diagonal."""
    space, bounded = problem.system.space, np.isfinite(problem.goal_lower)
    lower = np.where(bounded, problem.goal_lower, 0.0)
    upper = np.where(bounded, problem.goal_upper, 0.0)
    middle = (lower + upper) / 2
    if problem.wind:
        offset = space.difference(states, middle)
    else:
        offset = states - (problem.starts + space.difference(middle, problem.starts))
    offset = np.where(bounded, offset, 0.0)
    excess = np.sign(offset) * np.maximum(np.abs(offset) - (upper - lower) / 2, 0.0)
    return excess, (bounded & ((excess != 0) | (lower == upper))).astype(float)


def control_limits(system: System, limit: Box | None) -> tuple[Floats, Floats]:
    """(m,) least and largest controls within a limit; infinite without one."""
    if limit is None:
        free = np.full(system.control_box.dimension, np.inf)
        return -free, free
    return limit.lower, limit.upper
