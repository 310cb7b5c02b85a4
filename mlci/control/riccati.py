"""The Riccati recursion of `ilqr`: how the controls of a path should change, and with the state.

Costs are taken as quadratic and motions as linear around a path. With a 1 in front of the state, so
that slopes are a row of curvatures, and z = (1, x, u), w = (1, x, v), where a filter makes v of u,

    Q = G' (C + A' V A) G,    V = T' Q T

are the cost to go by z, and by (1, x) under the control that is best by Q: T maps (1, x) to z. The
motion from w to the next (1, x) is A, the running cost is C, and G = dw/dz, which leaves out the
filter's own curvature. C holds the Hessian of -r with negative eigenvalues taken as 0. The model of
the cost is then convex whatever the reward, so every step leads downhill if it is short; where -r
is not convex, in the control or the state, it is one of the first order only. Terms of second order
in the motion are left out as well, so the fixed points are those of the cost itself.
"""

from __future__ import annotations

import numpy as np

from mlci.compiled import compiled
from mlci.control.control_problem import ControlProblem, Paths, terminal_excess
from mlci.spaces import Floats

# Curvature of the running cost that damping is a multiple of, where the reward has none of its own.
_EFFORT = 2.0
_SWEEPS = 10  # of rotations over a matrix of controls; after five it is diagonal but for rounding
_4D = "f8[:, :, :, ::1]"


def feedback(problem: ControlProblem, paths: Paths, damping: Floats) -> tuple[Floats, Floats]:
    """Shift (K, B, m) and gain (K, B, m, n) of the control around paths.

    Where they are not finite no candidate is better, and the member gets more damping.

    Args:
        problem: of B members.
        paths: around which it is expanded.
        damping: (B,) ridge of Q_uu, in multiples of the largest curvature by a control along the
            path.
    """
    states, system, dt = paths.states[:-1], problem.system, problem.dt
    n, batch = states.shape[-1], states.shape[:-1]
    gradient, hessian = system.reward_derivatives(states, paths.applied)
    if not any(hessian.strides[:-2]):  # the same everywhere
        hessian = hessian[:1, :1]
    curvature = _convex(-hessian)
    largest = np.max(np.abs(curvature[..., n:, n:]), axis=(-2, -1))
    scale = np.max(np.broadcast_to(largest, batch), axis=0)
    expansion = (
        *problem.integrator.rate_jacobians(system, states, paths.applied, dt),
        *problem.safety_filter.linearize(states, paths.wanted),
        -gradient,
        np.broadcast_to(curvature, (*batch, *curvature.shape[-2:])),
    )
    excess, sides = terminal_excess(problem, paths.states[-1])
    sides = sides * np.square(problem.goal_scale)
    value = np.zeros((batch[1], 1 + n, 1 + n))
    value[:, 0, 1:] = value[:, 1:, 0] = 2 * problem.goal_weight * sides * excess
    value[:, 1:, 1:] = 2 * problem.goal_weight * sides[..., None] * np.eye(n)
    ridge = dt * np.where(scale > 0, scale, _EFFORT) * damping
    given = *expansion, paths.wanted, *problem.limits
    parts = (np.require(part, float, ["C", "W"]) for part in given)
    m = paths.wanted.shape[-1]
    d = 1 + n + m
    motion, through = np.eye(1 + n, d), np.zeros((m, d))
    room = motion, through, *np.empty((3, d, d)), np.empty((4, m, m))
    response = np.empty((*batch, m, 1 + n))
    _backwards(*parts, ridge, dt, value, room, response)
    return response[..., 0], response[..., 1:]


@compiled(
    f"void({_4D}, {_4D}, {_4D}, {_4D}, f8[:, :, ::1], {_4D}, f8[:, :, ::1], f8[::1], f8[::1], "
    f"f8[::1], f8, f8[:, :, ::1], Tuple(({', '.join(5 * ['f8[:, ::1]'])}, f8[:, :, ::1])), {_4D})"
)
def _backwards(
    drift: Floats,
    push: Floats,
    by_state: Floats,
    by_control: Floats,
    slope: Floats,
    curvature: Floats,
    wanted: Floats,
    lower: Floats,
    upper: Floats,
    ridge: Floats,
    dt: float,
    value: Floats,
    room: tuple[Floats, Floats, Floats, Floats, Floats, Floats],
    response: Floats,
) -> None:
    """The response (K, B, m, 1 + n) of the control to (1, x), the last rows of every T.

    Expanded around wanted controls (K, B, m) are the rate of the state, with the derivatives drift
    (K, B, n, n) and push (K, B, n, m); the applied control, by_state (K, B, m, n) and by_control
    (K, B, m, m); and the running cost [1/s], slope (K, B, n + m) and curvature (K, B, n + m,
    n + m). Controls are from lower (m,) to upper (m,), and ridge (B,) is added to the eigenvalues
    of Q_uu. V (B, 1 + n, 1 + n) of the last state is overwritten. Of the room, the first row of A
    and the first column of the last rows of G are given and stay.
    """
    motion, through, cost, q, products, of_controls = room
    n, m = push.shape[2:]
    for k in range(len(wanted) - 1, -1, -1):
        for b in range(len(value)):
            cost[0, 0] = 0.0
            for i in range(n + m):
                cost[0, 1 + i] = cost[1 + i, 0] = dt * slope[k, b, i]
                for j in range(n + m):
                    cost[1 + i, 1 + j] = dt * curvature[k, b, i, j]
            for j in range(n):
                for i in range(n):
                    motion[1 + i, 1 + j] = dt * drift[k, b, i, j] + (1.0 if i == j else 0.0)
                for i in range(m):
                    through[i, 1 + j] = by_state[k, b, i, j]
            for j in range(m):
                for i in range(n):
                    motion[1 + i, 1 + n + j] = dt * push[k, b, i, j]
                for i in range(m):
                    through[i, 1 + n + j] = by_control[k, b, i, j]
            _add_transformed(value[b], motion, products, cost)
            _substitute(through, cost, products, q)
            _respond(q, wanted[k, b], lower, upper, ridge[b], of_controls, response[k, b])
            _substitute(response[k, b], q, products, value[b])


@compiled("void(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])")
def _add_transformed(value: Floats, motion: Floats, room: Floats, cost: Floats) -> None:
    """Add A' V A (d, d) of a symmetric V (s, s) and a motion A (s, d) to a cost (d, d)."""
    s, d = motion.shape
    for i in range(s):
        for j in range(d):
            total = 0.0
            for r in range(s):
                total += value[i, r] * motion[r, j]
            room[i, j] = total
    for i in range(d):
        for j in range(i + 1):
            total = cost[i, j]
            for r in range(s):
                total += motion[r, i] * room[r, j]
            cost[i, j] = cost[j, i] = total


@compiled("void(f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])")
def _substitute(rows: Floats, matrix: Floats, room: Floats, result: Floats) -> None:
    """A symmetric form (s + m, s + m) in (y, v) as one (d, d) in z, of which y is the start.

    With v = rows z, and rows (m, d): B' M B where B = [1; rows].
    """
    m, d = rows.shape
    s = len(matrix) - m
    for r in range(m):
        for j in range(d):
            total = matrix[s + r, j] if j < s else 0.0
            for t in range(m):
                total += matrix[s + r, s + t] * rows[t, j]
            room[r, j] = total
    for i in range(d):
        for j in range(i + 1):
            total = 0.0
            if i < s:
                total = matrix[i, j]
                for r in range(m):
                    total += matrix[i, s + r] * rows[r, j]
            for r in range(m):
                total += rows[r, i] * room[r, j]
            result[i, j] = result[j, i] = total


@compiled("void(f8[:, ::1], f8[::1], f8[::1], f8[::1], f8, f8[:, :, ::1], f8[:, ::1])")
def _respond(
    q: Floats,
    wanted: Floats,
    lower: Floats,
    upper: Floats,
    ridge: float,
    room: Floats,
    response: Floats,
) -> None:
    """The response (m, 1 + n) is -(Q_uu + ridge 1)^-1 Q_uy, where y = (1, x).

    Negative eigenvalues of Q_uu count as 0. A control (m,) at an end of its range from which a
    lower cost would lead outside stays where it is, and the others take the Newton step without it
    (Tassa, Mansard and Todorov 2014, "Control-limited differential dynamic programming").
    """
    m, s = response.shape
    q_uu, vectors, inverse, part = room[0], room[1], room[2, 0], room[3, 0]
    for i in range(m):
        for j in range(m):
            q_uu[i, j] = q[s + i, s + j]
    for i in range(m):
        slope = q[s + i, 0]
        held = (wanted[i] <= lower[i] and slope > 0) or (wanted[i] >= upper[i] and slope < 0)
        for j in range(s):
            response[i, j] = 0.0 if held else -q[s + i, j]
        for j in range(m):
            if held:
                q_uu[i, j] = q_uu[j, i] = 0.0
    _diagonalize(q_uu, vectors)
    for e in range(m):
        inverse[e] = 1 / (ridge + (q_uu[e, e] if q_uu[e, e] > 0 else 0.0))
    for j in range(s):
        for e in range(m):
            part[e] = 0.0
            for i in range(m):
                part[e] += vectors[i, e] * response[i, j] * inverse[e]
        for i in range(m):
            response[i, j] = 0.0
            for e in range(m):
                response[i, j] += vectors[i, e] * part[e]


@compiled("void(f8[:, ::1], f8[:, ::1])")
def _diagonalize(matrix: Floats, vectors: Floats) -> None:
    """Turn a symmetric matrix (m, m) into its eigenvalues; the columns of `vectors` are theirs.

    By Jacobi's rotations, each of which makes an entry beside the diagonal 0 (Golub and Van Loan,
    "Matrix Computations", section 8.5).
    """
    m = len(matrix)
    for p in range(m):
        for r in range(m):
            vectors[p, r] = 1.0 if p == r else 0.0
    for _ in range(_SWEEPS if m > 1 else 0):
        for p in range(m - 1):
            for r in range(p + 1, m):
                if matrix[p, r] == 0.0:
                    continue
                ratio = (matrix[r, r] - matrix[p, p]) / (2 * matrix[p, r])
                tangent = 1 / (abs(ratio) + np.sqrt(ratio * ratio + 1))
                tangent = -tangent if ratio < 0 else tangent
                cosine = 1 / np.sqrt(tangent * tangent + 1)
                sine = tangent * cosine
                for i in range(m):
                    a, b = matrix[i, p], matrix[i, r]
                    matrix[i, p], matrix[i, r] = cosine * a - sine * b, sine * a + cosine * b
                    a, b = vectors[i, p], vectors[i, r]
                    vectors[i, p], vectors[i, r] = cosine * a - sine * b, sine * a + cosine * b
                for i in range(m):
                    a, b = matrix[p, i], matrix[r, i]
                    matrix[p, i], matrix[r, i] = cosine * a - sine * b, sine * a + cosine * b
                matrix[p, r] = matrix[r, p] = 0.0


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
