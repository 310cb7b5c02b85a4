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

from mlci.control_problem import (
    ControlFilter,
    ControlProblem,
    NoFilter,
    Paths,
    check_shapes,
    terminal_excess,
    total_cost,
)
from mlci.riccati import feedback
from mlci.simulate import EULER, Integrator
from mlci.spaces import Bools, Box, Floats, Ints
from mlci.systems import System

_STEP_SIZES: Floats = 0.5 ** np.arange(8.0)
# Damping, as multiples of the running cost's own curvature. The floor keeps Q_uu invertible where
# the filter overrules the control, which then has no effect at all.
_FLOOR, _FIRST, _LARGEST, _FACTOR = 1e-9, 1e-2, 1e8, 2.0


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

    Raises:
        ValueError: shapes that disagree, or a goal side with one infinite end.
    """
    starts, controls = np.asarray(starts, dtype=float), np.asarray(controls, dtype=float)
    check_shapes(system, starts, goal_lower, goal_upper, controls)
    filter_ = NoFilter() if safety_filter is None else safety_filter
    problem = ControlProblem(
        system, starts, goal_lower, goal_upper, dt, goal_weight, filter_, wind, limit, integrator
    )
    with np.errstate(over="ignore", invalid="ignore"):  # a diverging candidate is not an error
        paths = _first_paths(problem, np.moveaxis(controls, 1, 0))
        costs = _iterate(problem, paths, iterations, tolerance)
        if noise is not None:
            paths = _carry_out(problem, paths, np.moveaxis(noise, 1, 0))
    return Solution(
        np.moveaxis(paths.states, 0, 1).copy(),
        np.moveaxis(paths.applied, 0, 1).copy(),
        terminal_excess(problem, paths.states[-1])[0],
        costs,
    )


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
    scale, shape = sizes[:, None, None], (len(sizes), *problem.starts.shape)
    states = np.empty((len(shift) + 1, *shape))
    wanted = np.empty((len(shift), *shape[:2], shift.shape[-1]))
    applied = np.empty_like(wanted)
    states[0], step = problem.starts, problem.integrator.step
    for k in range(len(shift)):
        reaction = (gain[k] @ (states[k] - around.states[k])[..., None])[..., 0]
        wanted[k] = around.wanted[k] + scale * shift[k] + reaction
        if problem.limit is not None:
            wanted[k] = np.clip(wanted[k], problem.limit.lower, problem.limit.upper)
        applied[k] = problem.safety_filter.apply(states[k], wanted[k])
        states[k + 1] = step(problem.system, states[k], applied[k], problem.dt)
    return Paths(states, wanted, applied, total_cost(problem, states, applied))


def _adapt(damping: Floats, change: Floats, members: Ints, better: Bools) -> None:
    """Tassa's schedule: less damping, ever faster, after a success; more after a failure."""
    won, lost = members[better], members[~better]
    change[won] = np.minimum(1 / _FACTOR, change[won] / _FACTOR)
    damping[won] = np.where(
        damping[won] * change[won] >= _FIRST, damping[won] * change[won], _FLOOR
    )
    change[lost] = np.maximum(_FACTOR, change[lost] * _FACTOR)
    damping[lost] = np.maximum(_FIRST, damping[lost] * change[lost])
