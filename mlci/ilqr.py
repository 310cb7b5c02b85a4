"""The demonstrator's optimal control problem (8), solved for a whole batch by iLQR.

Iterative linear quadratic regulator with the Gauss-Newton Hessian (Li and Todorov 2004, "Iterative
linear quadratic regulator design for nonlinear biological movement systems"), with the
regularisation schedule of Tassa, Erez and Todorov 2012 ("Synthesis and stabilization of complex
behaviors through online trajectory optimization"). Each member of a batch minimises

    sum_k |v_k|^2 dt + goal_weight |excess(x_K)|^2,    x_{k+1} = x_k + dt h(x_k, v_k),

where v_k = filter(x_k, u_k) is the control that a safety filter lets through, u_k is the control
that is optimised, inside a box where there is a limit, and `excess` is how far the last state is
outside the goal: by the winding of periodic dimensions that is nearest to that state, or to the
start. Members never influence each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from mlci.simulate import euler_step
from mlci.spaces import Bools, Box, Floats, Ints
from mlci.systems import System

_STEP_SIZES: Floats = 0.5 ** np.arange(8.0)
# Regularisation, as multiples of the running cost's own curvature 2 dt. The floor keeps Quu
# invertible where the filter overrules the control, which then has no effect at all.
_FLOOR, _FIRST, _LARGEST, _FACTOR = 1e-9, 1e-2, 1e8, 2.0


class ControlFilter(Protocol):
    """What may stand between the optimised control and the system."""

    def apply(self, states: Floats, controls: Floats) -> Floats:
        """Applied controls (..., m) at states (..., n) and wanted controls (..., m)."""

    def linearize(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        """Derivatives of the applied control: by state (..., m, n), by control (..., m, m)."""


class _NoFilter:
    """Every control passes."""

    def apply(self, states: Floats, controls: Floats) -> Floats:
        return controls

    def linearize(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        m = controls.shape[-1]
        by_state = np.zeros((*controls.shape, states.shape[-1]))
        return by_state, np.broadcast_to(np.eye(m), (*controls.shape, m))


@dataclass(frozen=True, eq=False)
class Solution:
    """What `optimize` found for each of B members.

    Attributes:
        states: (B, K+1, n) path, not wrapped.
        controls: (B, K, m) applied controls, after the filter.
        excess: (B, n) how far the last state is outside the goal in each dimension, signed.
        costs: (iterations + 1, B) cost after each iteration, the first guess's before it; inf for
            a member whose first guess overflows.
    """

    states: Floats
    controls: Floats
    excess: Floats
    costs: Floats

    @property
    def cost(self) -> Floats:
        """(B,) final cost: effort plus the goal's penalty."""
        return self.costs[-1]


@dataclass(frozen=True, eq=False)
class _Problem:
    """The problems of B members, with the shapes of `optimize`."""

    system: System
    starts: Floats
    goal_lower: Floats
    goal_upper: Floats
    dt: float
    goal_weight: float
    safety_filter: ControlFilter
    wind: bool
    limit: Box | None

    def of(self, members: Ints) -> _Problem:
        """The problems of some members only."""
        chosen = self.starts[members], self.goal_lower[members], self.goal_upper[members]
        return replace(self, starts=chosen[0], goal_lower=chosen[1], goal_upper=chosen[2])


@dataclass(frozen=True, eq=False)
class _Path:
    """Paths, time first: states (K+1, B, n), wanted and applied controls (K, B, m), cost (B,)."""

    states: Floats
    wanted: Floats
    applied: Floats
    cost: Floats

    def of(self, *index: Any) -> _Path:
        """The paths at an index into the axes behind time."""
        at = (slice(None), *index)
        return _Path(self.states[at], self.wanted[at], self.applied[at], self.cost[index])

    def put(self, members: Ints, other: _Path) -> None:
        """Overwrite the paths of some members."""
        self.states[:, members], self.wanted[:, members] = other.states, other.wanted
        self.applied[:, members], self.cost[members] = other.applied, other.cost


def optimize(
    system: System,
    starts: Floats,
    goal_lower: Floats,
    goal_upper: Floats,
    controls: Floats,
    dt: float,
    *,
    goal_weight: float = 300.0,
    iterations: int = 10,
    tolerance: float = 1e-9,
    safety_filter: ControlFilter | None = None,
    wind: bool = True,
    limit: Box | None = None,
) -> Solution:
    """Solve (8) for every member of a batch, from its own first guess.

    The running cost is |u|^2, whatever the system's `running_reward`.

    Args:
        starts: (B, n) first states.
        goal_lower: (B, n) lower corners of the goals, -inf where a dimension is free.
        goal_upper: (B, n) upper corners, +inf where free; equal to the lower ones for a point.
        controls: (B, K, m) first guesses.
        dt: time step of the explicit Euler integrator [s].
        goal_weight: price of the squared terminal error, in cost per squared unit of the state.
        iterations: at most so many.
        tolerance: a member stops when an iteration lowers its cost by a smaller share than this.
        safety_filter: acts inside the rollout and its derivatives in the linearisation.
        wind: whether any number of turns may lead to the goal; else only the winding of its middle
            that is nearest to the start, at most half a turn away.
        limit: range that controls are clipped to, before the filter; None for no limit.

    Raises:
        ValueError: shapes that disagree, or a goal side with one infinite end.
    """
    starts, controls = np.asarray(starts, dtype=float), np.asarray(controls, dtype=float)
    _check(system, starts, goal_lower, goal_upper, controls)
    filter_ = _NoFilter() if safety_filter is None else safety_filter
    problem = _Problem(
        system, starts, goal_lower, goal_upper, dt, goal_weight, filter_, wind, limit
    )
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging candidate is not an error
        guess = np.moveaxis(controls, 1, 0)
        zero = np.zeros((len(guess) + 1, *starts.shape))
        around = _Path(zero, guess, guess, np.zeros(len(starts)))
        gain = np.zeros((*guess.shape, starts.shape[1]))
        path = _roll_out(problem, around, 0 * guess, gain, _STEP_SIZES[:1]).of(0)
        damping, change = np.full(len(starts), _FLOOR), np.ones(len(starts))
        active = np.isfinite(path.cost)
        costs = [path.cost.copy()]
        for _ in range(iterations):
            members = np.flatnonzero(active)
            if len(members):
                before = path.of(members)
                after, better = _improve(problem.of(members), before, damping[members])
                path.put(members[better], after.of(better))
                _adapt(damping, change, members, better)
                small = better & (before.cost - after.cost <= tolerance * before.cost)
                active[members] = ~small & (damping[members] <= _LARGEST)
            costs.append(path.cost.copy())
    return Solution(
        np.moveaxis(path.states, 0, 1).copy(),
        np.moveaxis(path.applied, 0, 1).copy(),
        _terminal(problem, path.states[-1])[0],
        np.array(costs),
    )


def _check(system: System, starts: Floats, lower: Floats, upper: Floats, controls: Floats) -> None:
    """Refuse shapes that disagree and goals bounded at one end only."""
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


def _terminal(problem: _Problem, states: Floats) -> tuple[Floats, Floats]:
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


def _improve(problem: _Problem, path: _Path, damping: Floats) -> tuple[_Path, Bools]:
    """One iteration: the best candidates, (B,) and which of them are cheaper than `path`."""
    shift, gain = _backward(problem, path, damping)
    candidates = _roll_out(problem, path, shift, gain, _STEP_SIZES)
    chosen = candidates.of(np.argmin(candidates.cost, axis=0), np.arange(len(damping)))
    return chosen, np.asarray(chosen.cost < path.cost)


def _backward(problem: _Problem, path: _Path, damping: Floats) -> tuple[Floats, Floats]:
    """Riccati recursion along paths: shift (K, B, m) and gain (K, B, m, n) of the control.

    With z = (x, u): Q_zz = L_zz + F' V_xx F and Q_z = L_z + F' V_x, where F = [dx'/dx, dx'/du].
    Where they are not finite no candidate is better, and the member gets more damping.
    """
    system, dt = problem.system, problem.dt
    states, wanted, applied = path.states, path.wanted, path.applied
    n = states.shape[-1]
    by_state, by_control = problem.safety_filter.linearize(states[:-1], wanted)
    through = np.concatenate([by_state, by_control], axis=-1)  # dv/dz
    drift, push = system.jacobians(states[:-1], applied)
    step = dt * (push @ through)
    step[..., :n] += dt * drift + np.eye(n)
    curvature = 2 * dt * (through.mT @ through)
    slope = 2 * dt * (through.mT @ applied[..., None])[..., 0]

    excess, sides = _terminal(problem, states[-1])
    value_x = 2 * problem.goal_weight * sides * excess
    value_xx = 2 * problem.goal_weight * sides[..., None] * np.eye(n)
    shift, gain = np.empty_like(wanted), np.empty((*wanted.shape, n))
    for k in reversed(range(len(wanted))):
        q_z = slope[k] + (step[k].mT @ value_x[..., None])[..., 0]
        q_zz = curvature[k] + step[k].mT @ value_xx @ step[k]
        q_uu, q_ux = q_zz[:, n:, n:], q_zz[:, n:, :n]
        free = _free(problem.limit, wanted[k], q_z[:, n:])[..., None]
        held = (1 - free) * np.eye(free.shape[1])
        inverse = _inverses(free * q_uu * free.mT + held, 2 * dt * damping)
        shift[k] = -(inverse @ (free * q_z[:, n:, None]))[..., 0]
        gain[k] = -(inverse @ (free * q_ux))
        # The form that stays exact for gains of a damped Q_uu.
        turn = gain[k].mT
        value_x = q_z[:, :n] + (turn @ (q_uu @ shift[k][..., None] + q_z[:, n:, None]))[..., 0]
        value_x += (q_ux.mT @ shift[k][..., None])[..., 0]
        value_xx = q_zz[:, :n, :n] + turn @ (q_uu @ gain[k] + q_ux) + q_ux.mT @ gain[k]
        value_xx = (value_xx + value_xx.mT) / 2
    return shift, gain


def _free(limit: Box | None, wanted: Floats, slope: Floats) -> Floats:
    """(B, m) 0 for a control at an end of its range from which a lower cost would lead outside.

    Such controls stay where they are, and the others take the Newton step without them (Tassa,
    Mansard and Todorov 2014, "Control-limited differential dynamic programming").
    """
    if limit is None:
        return np.ones(wanted.shape)
    outward = (wanted <= limit.lower) & (slope > 0) | (wanted >= limit.upper) & (slope < 0)
    return np.where(outward, 0.0, 1.0)


def _inverses(matrices: Floats, ridge: Floats) -> Floats:
    """(Q + ridge 1)^-1 (B, m, m) of symmetric matrices, negative eigenvalues taken as 0."""
    finite = np.asarray(np.all(np.isfinite(matrices), axis=(1, 2)))
    values, vectors = np.linalg.eigh(np.where(finite[:, None, None], matrices, 0.0))
    return (vectors / (np.maximum(values, 0.0) + ridge[:, None])[:, None, :]) @ vectors.mT


def _roll_out(
    problem: _Problem, around: _Path, shift: Floats, gain: Floats, sizes: Floats
) -> _Path:
    """Paths under u = wanted + size * shift + gain (x - x_around), for all sizes (L) at once.

    The arrays of the result have an axis L before B.
    """
    scale, shape = sizes[:, None, None], (len(sizes), *problem.starts.shape)
    states = np.empty((len(shift) + 1, *shape))
    wanted = np.empty((len(shift), *shape[:2], shift.shape[-1]))
    applied = np.empty_like(wanted)
    states[0] = problem.starts
    for k in range(len(shift)):
        feedback = (gain[k] @ (states[k] - around.states[k])[..., None])[..., 0]
        wanted[k] = around.wanted[k] + scale * shift[k] + feedback
        if problem.limit is not None:
            wanted[k] = np.clip(wanted[k], problem.limit.lower, problem.limit.upper)
        applied[k] = problem.safety_filter.apply(states[k], wanted[k])
        states[k + 1] = euler_step(problem.system, states[k], applied[k], problem.dt)
    excess, _ = _terminal(problem, states[-1])
    effort = np.sum(np.square(applied), axis=(0, -1)) * problem.dt
    cost = effort + problem.goal_weight * np.sum(np.square(excess), axis=-1)
    return _Path(states, wanted, applied, np.where(np.isfinite(cost), cost, np.inf))


def _adapt(damping: Floats, change: Floats, members: Ints, better: Bools) -> None:
    """Tassa's schedule: less damping, ever faster, after a success; more after a failure."""
    won, lost = members[better], members[~better]
    change[won] = np.minimum(1 / _FACTOR, change[won] / _FACTOR)
    damping[won] = np.where(
        damping[won] * change[won] >= _FIRST, damping[won] * change[won], _FLOOR
    )
    change[lost] = np.maximum(_FACTOR, change[lost] * _FACTOR)
    damping[lost] = np.maximum(_FIRST, damping[lost] * change[lost])
