"""The Riccati recursion of `ilqr`: how the controls of a path should change, and with the state.

Costs are taken as quadratic and motions as linear around a path, in z = (x, u). With the running
cost's slope L_z and curvature L_zz, and F = [dx'/dx, dx'/du],

    Q_z = L_z + F' V_x,    Q_zz = L_zz + F' V_xx F.

L_zz is G' C G with G = d(x, v)/dz, which leaves out the filter's own curvature, and where C is the
Hessian of -r in (x, v) with negative eigenvalues taken as 0. The model of the cost is then convex
whatever the reward, so every step leads downhill if it is short; where -r is not convex, in the
control or the state, it is one of the first order only. Terms of second order in the motion are
left out as well, so the fixed points are those of the cost itself.
"""

from __future__ import annotations

import numpy as np

from mlci.control_problem import ControlProblem, Paths, terminal_excess
from mlci.spaces import Box, Floats

# Curvature of the running cost that damping is a multiple of, where the reward has none of its own.
_EFFORT = 2.0


def feedback(problem: ControlProblem, paths: Paths, damping: Floats) -> tuple[Floats, Floats]:
    """Shift (K, B, m) and gain (K, B, m, n) of the control around paths.

    Where they are not finite no candidate is better, and the member gets more damping.

    Args:
        problem: of B members.
        paths: around which it is expanded.
        damping: (B,) ridge of Q_uu, in multiples of the largest curvature by a control along the
            path.
    """
    n = paths.states.shape[-1]
    step, through = _motion(problem, paths)
    slope, curvature, scale = _running_cost(problem, paths, through)
    ridge = problem.dt * scale * damping
    excess, sides = terminal_excess(problem, paths.states[-1])
    value_x = 2 * problem.goal_weight * sides * excess
    value_xx = 2 * problem.goal_weight * sides[..., None] * np.eye(n)
    shift, gain = np.empty_like(paths.wanted), np.empty((*paths.wanted.shape, n))
    for k in reversed(range(len(shift))):
        q_z = slope[k] + (step[k].mT @ value_x[..., None])[..., 0]
        q_zz = curvature[k] + step[k].mT @ value_xx @ step[k]
        q_uu, q_ux = q_zz[:, n:, n:], q_zz[:, n:, :n]
        free = _free(problem.limit, paths.wanted[k], q_z[:, n:])[..., None]
        held = (1 - free) * np.eye(free.shape[1])
        inverse = _inverses(free * q_uu * free.mT + held, ridge)
        shift[k] = -(inverse @ (free * q_z[:, n:, None]))[..., 0]
        gain[k] = -(inverse @ (free * q_ux))
        # The form that stays exact for gains of a damped Q_uu.
        turn = gain[k].mT
        value_x = q_z[:, :n] + (turn @ (q_uu @ shift[k][..., None] + q_z[:, n:, None]))[..., 0]
        value_x += (q_ux.mT @ shift[k][..., None])[..., 0]
        value_xx = q_zz[:, :n, :n] + turn @ (q_uu @ gain[k] + q_ux) + q_ux.mT @ gain[k]
        value_xx = (value_xx + value_xx.mT) / 2
    return shift, gain


def _motion(problem: ControlProblem, paths: Paths) -> tuple[Floats, Floats]:
    """F (K, B, n, n + m), and dv/dz (K, B, m, n + m)."""
    states, dt = paths.states[:-1], problem.dt
    n = states.shape[-1]
    through = np.concatenate(problem.safety_filter.linearize(states, paths.wanted), axis=-1)
    jacobians = problem.integrator.rate_jacobians
    drift, push = jacobians(problem.system, states, paths.applied, dt)
    step = dt * (push @ through)
    step[..., :n] += dt * drift + np.eye(n)
    return step, through


def _running_cost(
    problem: ControlProblem, paths: Paths, through: Floats
) -> tuple[Floats, Floats, Floats]:
    """L_z (K, B, n + m), L_zz (K, B, n + m, n + m), and the largest curvature by a control (B,)."""
    n = paths.states.shape[-1]
    gradient, hessian = problem.system.reward_derivatives(paths.states[:-1], paths.applied)
    if not any(hessian.strides[:-2]):  # the same everywhere
        hessian = hessian[:1, :1]
    gradient, hessian = -gradient, _convex(-hessian)
    slope = (through.mT @ gradient[..., n:, None])[..., 0]
    slope[..., :n] += gradient[..., :n]
    by_controls = hessian[..., n:, n:]
    curvature = through.mT @ by_controls @ through
    if hessian[..., :n].any():  # few rewards tell states apart
        mixed = hessian[..., :n, n:] @ through
        curvature[..., :n, :] += mixed
        curvature[..., :, :n] += mixed.mT
        curvature[..., :n, :n] += hessian[..., :n, :n]
    largest = np.broadcast_to(np.max(np.abs(by_controls), axis=(-2, -1)), slope.shape[:2])
    scale = np.max(largest, axis=0)
    return problem.dt * slope, problem.dt * curvature, np.where(scale > 0, scale, _EFFORT)


def _convex(matrices: Floats) -> Floats:
    """Symmetric matrices (..., d, d) with negative eigenvalues taken as 0."""
    diagonal = np.diagonal(matrices, axis1=-2, axis2=-1)
    others = np.sum(np.abs(matrices), axis=-1) - np.abs(diagonal)
    doubtful = np.any(diagonal < others, axis=-1)  # else Gershgorin's circles are not below 0
    doubtful &= np.all(np.isfinite(matrices), axis=(-2, -1))
    if doubtful.any():
        matrices = matrices.copy()
        values, vectors = np.linalg.eigh(matrices[doubtful])
        matrices[doubtful] = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.mT
    return matrices


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
