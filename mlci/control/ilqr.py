"""The demonstrator's optimal control problem (8), solved for a whole batch by iLQR.

Iterative linear quadratic regulator with the Gauss-Newton Hessian (Li and Todorov 2004, "Iterative
linear quadratic regulator design for nonlinear biological movement systems"), with the
regularisation schedule of Tassa, Erez and Todorov 2012 ("Synthesis and stabilization of complex
behaviors through online trajectory optimization"). `control_problem` states what is minimised, and
`riccati` how a path is improved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mlci.compiled import compiled
from mlci.control.control_problem import (
    ControlFilter,
    ControlProblem,
    NoFilter,
    Paths,
    check_shapes,
    terminal_excess,
    total_cost,
)
from mlci.control.riccati import feedback
from mlci.simulate import EULER, Integrator
from mlci.spaces import Bools, Box, Floats, Ints
from mlci.systems import System

_STEP_SIZES: Floats = 0.5 ** np.arange(8.0)
# Damping, as multiples of the running cost's own curvature. The floor keeps Q_uu invertible where
# the filter overrules the control, which then has no effect at all.
_FLOOR, _FIRST, _LARGEST, _FACTOR = 1e-9, 1e-2, 1e8, 2.0
_ROUNDING = 1e-9  # of a clearance that counts as none


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
        """(B,) final cost, without noise: minus the reward on the way, plus the goal's penalty."""
        return self.costs[-1]


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
    integrator: Integrator = EULER,
    noise: Floats | None = None,
    goal_scale: float | Floats = 1.0,
) -> Solution:
    """Solve (8) for every member of a batch, from its own first guess.

    Args:
        system: dynamics, and the running reward whose integral is maximised.
        starts: (B, n), and so on: see `ControlProblem`.
        goal_lower: (B, n) lower corners of the goals.
        goal_upper: (B, n) upper corners.
        controls: (B, K, m) first guesses.
        dt: time step of the integrator [s].
        goal_weight: price of the squared terminal error.
        iterations: at most so many.
        tolerance: a member stops when an iteration lowers its cost by a smaller share than this.
        safety_filter: acts inside the rollout and its derivatives in the linearisation.
        wind: whether any number of turns may lead to the goal.
        limit: range of the controls.
        integrator: how states move on in a time step.
        noise: (B, K, m) on the controls when the optimum is carried out. Nobody knows it before,
            and the optimum's feedback corrects what it does; limit and filter follow it.
        goal_scale: multiplies the terminal error, or (n,) that of each dimension.

    Raises:
        ValueError: shapes that disagree, or a goal side with one infinite end.
    """
    starts, controls = np.asarray(starts, dtype=float), np.asarray(controls, dtype=float)
    check_shapes(system, starts, goal_lower, goal_upper, controls)
    filter_ = NoFilter() if safety_filter is None else safety_filter
    problem = ControlProblem(
        *(system, starts, goal_lower, goal_upper, dt, goal_weight, filter_, wind, limit),
        *(integrator, goal_scale),
    )
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging candidate is not an error
        paths = _first_paths(problem, np.moveaxis(controls, 1, 0))
        costs = _iterate(problem, paths, iterations, tolerance)
        if noise is not None:
            paths = _carry_out(problem, paths, np.moveaxis(noise, 1, 0))
        _hold_where_lost(paths)
    return Solution(
        np.moveaxis(paths.states, 0, 1).copy(),
        np.moveaxis(paths.applied, 0, 1).copy(),
        terminal_excess(problem, paths.states[-1])[0],
        costs,
    )


def _hold_where_lost(paths: Paths) -> None:
    """Let paths that leave the range of numbers stay at their last finite state, in place.

    No control is applied from there on, and their cost stays NaN or infinite.
    """
    known = np.logical_and.accumulate(np.all(np.isfinite(paths.states), axis=-1), axis=0)
    last = paths.states[np.sum(known, axis=0) - 1, np.arange(known.shape[1])]
    paths.states[~known] = np.broadcast_to(last, paths.states.shape)[~known]
    paths.applied[~known[1:]] = 0.0


def _first_paths(problem: ControlProblem, guess: Floats) -> Paths:
    """The paths under first guesses (K, B, m)."""
    zero = np.zeros((len(guess) + 1, *problem.starts.shape))
    around = Paths(zero, guess, guess, np.zeros(guess.shape[1]))
    gain = np.zeros((*guess.shape, zero.shape[-1]))
    return _roll_out(problem, around, 0 * guess, gain, _STEP_SIZES[:1]).of(0)


def _carry_out(problem: ControlProblem, paths: Paths, noise: Floats) -> Paths:
    """The paths under noise (K, B, m) on the controls, with the feedback of the last iteration."""
    shift, gain = feedback(problem, paths, np.full(len(problem.starts), _FLOOR))
    around = replace(paths, wanted=paths.wanted + noise)
    return _roll_out(problem, around, 0 * shift, gain, _STEP_SIZES[:1]).of(0)


def _iterate(problem: ControlProblem, paths: Paths, iterations: int, tolerance: float) -> Floats:
    """Improve paths in place; costs (iterations + 1, B) before, and after each iteration."""
    count = len(problem.starts)
    damping, change = np.full(count, _FLOOR), np.ones(count)
    active = np.isfinite(paths.cost)
    costs = [paths.cost.copy()]
    for _ in range(iterations):
        members = np.flatnonzero(active)
        if len(members):
            before = paths.of(members)
            after, better = _improve(problem.of(members), before, damping[members])
            paths.put(members[better], after.of(better))
            _adapt(damping, change, members, better)
            small = better & (before.cost - after.cost <= tolerance * np.abs(before.cost))
            active[members] = ~small & (damping[members] <= _LARGEST)
        costs.append(paths.cost.copy())
    return np.array(costs)


def _improve(problem: ControlProblem, paths: Paths, damping: Floats) -> tuple[Paths, Bools]:
    """One iteration: the best candidates, and (B,) which of them are cheaper than `paths`."""
    shift, gain = feedback(problem, paths, damping)
    candidates = _roll_out(problem, paths, shift, gain, _STEP_SIZES)
    best = candidates.of(np.argmin(candidates.cost, axis=0), np.arange(len(damping)))
    return best, np.asarray(best.cost < paths.cost)


def _roll_out(
    problem: ControlProblem, around: Paths, shift: Floats, gain: Floats, sizes: Floats
) -> Paths:
    """Paths under u = wanted + size * shift + gain (x - x_around), for all sizes (L) at once.

    The arrays of the result have an axis L before B.
    """
    steps, members, m = shift.shape
    count, n = len(sizes) * members, problem.starts.shape[1]
    states, wanted = _columns_apart(steps + 1, count, n), _columns_apart(steps, count, m)
    applied, clearance = _columns_apart(steps, count, m), np.zeros(count)
    states[0] = np.tile(problem.starts, (len(sizes), 1))
    for k in range(steps):
        _set_controls(
            *(around.states[k], around.wanted[k], shift[k], gain[k], sizes, states[k]),
            *(*problem.limits, wanted[k]),
        )
        _advance(problem, states[k], wanted[k], applied[k], states[k + 1], clearance)
    states, wanted, applied = (
        each.reshape(len(each), len(sizes), members, -1) for each in (states, wanted, applied)
    )
    return Paths(states, wanted, applied, total_cost(problem, states, applied))


def _columns_apart(steps: int, count: int, dimension: int) -> Floats:
    """An array (K, N, d) whose columns are contiguous: numpy is slow along so short an axis."""
    return np.empty((steps, dimension, count)).transpose(0, 2, 1)


def _advance(
    problem: ControlProblem,
    states: Floats,
    wanted: Floats,
    applied: Floats,
    ahead: Floats,
    clearance: Floats,
) -> None:
    """Fill applied controls (N, m) and the states (N, n) ahead to which they lead.

    The filter is asked where the clearance (N,) is used up, by how far states may move before it
    could act, and renews it.
    """
    system, dt, step = problem.system, problem.dt, problem.integrator.step
    applied[:], ahead[:] = wanted, step(system, states, wanted, dt)
    moves = ahead - states
    clearance -= np.sqrt(np.einsum("bi,bi->b", moves, moves))
    near = np.flatnonzero(~(clearance > _ROUNDING))
    if not len(near):
        return
    here, control, there = states[near], wanted[near], ahead[near]
    filtered = problem.safety_filter.apply(here, control, there)
    changed = (filtered != control).any(axis=-1)
    if changed.any():
        there[changed] = step(system, here[changed], filtered[changed], dt)
        applied[near], ahead[near] = filtered, there
    clearance[near] = problem.safety_filter.clearance(there)


# numba's types of arrays that are only read, in any layout, by their number of axes.
_R1, _R2, _R3 = (f"Array(f8, {axes}, 'A', readonly=True)" for axes in (1, 2, 3))


@compiled(f"void({_R2}, {_R2}, {_R2}, {_R3}, {_R1}, {_R2}, {_R1}, {_R1}, f8[:, :])")
def _set_controls(
    around: Floats,
    planned: Floats,
    shift: Floats,
    gain: Floats,
    sizes: Floats,
    states: Floats,
    lower: Floats,
    upper: Floats,
    wanted: Floats,
) -> None:
    """Set wanted controls (L * B, m) of one stage at states (L * B, n), clipped to a range.

    Around the states (B, n) of a path with planned controls (B, m) they differ from those by
    sizes (L,) times the shift (B, m), and by the gain (B, m, n) times the difference of the states.
    """
    members, m = planned.shape
    for i in range(len(states)):
        b, size = i % members, sizes[i // members]
        for j in range(m):
            reaction = 0.0
            for d in range(states.shape[1]):
                reaction += gain[b, j, d] * (states[i, d] - around[b, d])
            control = planned[b, j] + size * shift[b, j] + reaction
            control = lower[j] if control < lower[j] else control
            wanted[i, j] = upper[j] if control > upper[j] else control


def _adapt(damping: Floats, change: Floats, members: Ints, better: Bools) -> None:
    """Tassa's schedule: less damping, ever faster, after a success; more after a failure."""
    won, lost = members[better], members[~better]
    change[won] = np.minimum(1 / _FACTOR, change[won] / _FACTOR)
    damping[won] = np.where(
        damping[won] * change[won] >= _FIRST, damping[won] * change[won], _FLOOR
    )
    change[lost] = np.maximum(_FACTOR, change[lost] * _FACTOR)
    damping[lost] = np.maximum(_FIRST, damping[lost] * change[lost])
