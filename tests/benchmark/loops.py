"""What a compiled language does with the equations written down as they read: plain loops.

The benchmark's floor of effort. Nothing here is shared with the project, so that answers can be
compared.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

njit: Any = numba.njit(cache=True, error_model="numpy")


@njit
def _neighbours(shape, periodic):  # type: ignore[no-untyped-def]
    """(S, n, 4) cells two before, one before, one behind and two behind along each dimension."""
    n, size = len(shape), 1
    for count in shape:
        size *= count
    table = np.empty((size, n, 4), dtype=np.int32)
    stride = size
    for d in range(n):
        stride //= shape[d]
        for s in range(size):
            place = (s // stride) % shape[d]
            for k, shift in enumerate((-2, -1, 1, 2)):
                to = place + shift
                to = to % shape[d] if periodic[d] else min(max(to, 0), shape[d] - 1)
                table[s, d, k] = s + (to - place) * stride
    return table


@njit
def _bend(one, other):  # type: ignore[no-untyped-def]
    """A sixth of a second difference and of the one beyond: Koren's limiter."""
    mean = (2 * one + other) / 6
    return max(min(mean, max(min(one, other), 0.0)), min(max(one, other), 0.0))


@njit
def _fall(values, velocities, beside, fall):  # type: ignore[no-untyped-def]
    """min{0, max_u grad V . h} of every cell into `fall`, third order."""
    n = velocities.shape[2]
    left, right = np.empty(n), np.empty(n)
    for s in range(len(values)):
        here = values[s]
        for d in range(n):
            far, near, after, beyond = beside[s, d]
            low, high = here - values[near], values[after] - here
            left[d] = low + _bend(high - low, low - (values[near] - values[far]))
            right[d] = high - _bend(high - low, values[beyond] - values[after] - high)
        best = -np.inf
        for u in range(len(velocities)):
            total = 0.0
            for d in range(n):
                rate = velocities[u, s, d]
                total += rate * (right[d] if rate > 0 else left[d])
            best = max(best, total)
        fall[s] = min(best, 0.0)


@njit
def upwind(values, velocities, shape, periodic, step, steps):  # type: ignore[no-untyped-def]
    """V (S,) after some steps of Shu and Osher's scheme, from V, and rates (U, S, n) in cells."""
    beside = _neighbours(shape, periodic)
    fall, once = np.empty_like(values), np.empty_like(values)
    values = values.copy()
    for _ in range(steps):
        _fall(values, velocities, beside, fall)
        for s in range(len(values)):
            once[s] = values[s] + step * fall[s]
        _fall(once, velocities, beside, fall)
        for s in range(len(values)):
            values[s] = (values[s] + once[s] + step * fall[s]) / 2
    return values


@njit
def _rates(kind, x, u, rates):  # type: ignore[no-untyped-def]
    """h of the pendulum (0), the telescoping pendulum (1) and the torus (2)."""
    if kind == 0:
        rates[0], rates[1] = x[1], np.sin(x[0]) + u[0]
    elif kind == 1:
        rates[0], rates[1] = x[1], 10.0 / x[2] * np.sin(x[0]) + u[0]
        rates[2], rates[3] = x[3], u[1]
    else:
        for d in range(len(x)):
            rates[d] = u[d % 2] + np.sin(x[(d + 1) % len(x)])


@njit
def _step(kind, x, u, dt, k, now):  # type: ignore[no-untyped-def]
    """A Runge-Kutta step of x (n,) in place; k (4, n) and now (n,) are room to work."""
    for stage in range(4):
        reach = (0.0, dt / 2, dt / 2, dt)[stage]
        for d in range(len(x)):
            now[d] = x[d] + reach * k[max(stage - 1, 0), d] if stage else x[d]
        _rates(kind, now, u, k[stage])
    for d in range(len(x)):
        x[d] += dt / 6 * (k[0, d] + 2 * k[1, d] + 2 * k[2, d] + k[3, d])


@njit
def _meets(first, last, low, high, period):  # type: ignore[no-untyped-def]
    """Whether a chord enters the interior of a box, or of the image of it that is nearest."""
    enter, leave = -np.inf, np.inf
    for d in range(len(first)):
        step, lower, upper = last[d] - first[d], low[d], high[d]
        if period[d] > 0 and lower > -np.inf:
            apart = (first[d] + last[d] - lower - upper) / 2
            turn = np.floor(apart / period[d] + 0.5) * period[d]
            lower, upper = lower + turn, upper + turn
        if step == 0:
            if not lower < first[d] < upper:
                return False
        else:
            one, other = (lower - first[d]) / step, (upper - first[d]) / step
            enter, leave = max(enter, min(one, other)), min(leave, max(one, other))
            if enter >= leave or enter >= 1 or leave <= 0:
                return False
    return enter < leave and enter < 1 and leave > 0


@njit
def discretise(kind, centers, actions, dt, substeps, bounds, periodic, shape, low, high):  # type: ignore[no-untyped-def]
    """Successor (S, A), S where a move leaves the grid, and which regions it keeps out of.

    Every chord is held against every region, (S, A, C).
    """
    cells, n = centers.shape
    successor = np.empty((cells, len(actions)), dtype=np.int32)
    keeps = np.ones((cells, len(actions), len(low)), dtype=np.uint8)
    x, before, now, k = np.empty(n), np.empty(n), np.empty(n), np.empty((4, n))
    period = np.where(periodic, bounds[1] - bounds[0], 0.0)
    for s in range(cells):
        for a in range(len(actions)):
            x[:] = centers[s]
            inside = True
            for _ in range(substeps):
                before[:] = x
                _step(kind, x, actions[a], dt / substeps, k, now)
                for d in range(n):
                    inside &= periodic[d] or bounds[0, d] <= x[d] <= bounds[1, d]
                if not inside:
                    break
                for i in range(len(low)):
                    if keeps[s, a, i] and _meets(before, x, low[i], high[i], period):
                        keeps[s, a, i] = 0
            number = cells if not inside else 0
            if inside:
                for d in range(n):
                    width = (bounds[1, d] - bounds[0, d]) / shape[d]
                    place = int(np.floor((x[d] - bounds[0, d]) / width))
                    place = place % shape[d] if periodic[d] else min(place, shape[d] - 1)
                    number = number * shape[d] + place
            successor[s, a] = number
    return successor, keeps


@njit
def log_z_and_phi(successor, reward, keeps, start, goal, steps):  # type: ignore[no-untyped-def]
    """log Z (T+1, S+1) of the cells that can be reached and reach a goal, and Phi (C,)."""
    cells, moves = successor.shape
    regions = keeps.shape[2]
    log_z = np.full((steps + 1, cells + 1), -np.inf)
    reached = np.zeros((steps + 1, cells + 1), dtype=np.bool_)
    reached[0, start] = True
    for t in range(steps):
        for s in range(cells):
            if reached[t, s]:
                for a in range(moves):
                    reached[t + 1, successor[s, a]] = True
    for cell in goal:
        if reached[steps, cell]:
            log_z[steps, cell] = 0.0
    for t in range(steps - 1, -1, -1):
        for s in range(cells):
            if reached[t, s]:
                best = -np.inf
                for a in range(moves):
                    best = max(best, reward[s, a] + log_z[t + 1, successor[s, a]])
                if best > -np.inf:
                    total = 0.0
                    for a in range(moves):
                        total += np.exp(reward[s, a] + log_z[t + 1, successor[s, a]] - best)
                    log_z[t, s] = best + np.log(total)
    alpha, after = np.zeros((cells, regions)), np.ones((cells, regions))
    for t in range(steps - 1, -1, -1):
        for s in range(cells):
            if log_z[t, s] > -np.inf:
                alpha[s] = 0.0
                for a in range(moves):
                    to = successor[s, a]
                    if log_z[t + 1, to] > -np.inf:
                        share = np.exp(reward[s, a] + log_z[t + 1, to] - log_z[t, s])
                        for i in range(regions):
                            alpha[s, i] += share * after[to, i] * keeps[s, a, i]
        alpha, after = after, alpha
    return log_z, 1 - after[start]


@njit
def _pendulum_path(x, u, goal, dt, weight):  # type: ignore[no-untyped-def]
    """Fill x (K+1, 2) by Euler steps under u (K,), and return the cost of (8)."""
    cost = 0.0
    for k in range(len(u)):
        x[k + 1, 0] = x[k, 0] + dt * x[k, 1]
        x[k + 1, 1] = x[k, 1] + dt * (np.sin(x[k, 0]) + u[k])
        cost += dt * u[k] ** 2
    return cost + weight * ((x[-1, 0] - goal[0]) ** 2 + (x[-1, 1] - goal[1]) ** 2)


@njit
def ilqr(start, goal, guess, dt, weight, iterations, tolerance):  # type: ignore[no-untyped-def]
    """Cost of the pendulum's optimum from a guess (K,); of eight steps the first that gains."""
    steps = len(guess)
    u, trial_u, x, trial = (
        guess.copy(),
        guess.copy(),
        np.empty((steps + 1, 2)),
        np.empty((steps + 1, 2)),
    )
    shift, gain = np.empty(steps), np.empty((steps, 2))
    x[0], trial[0] = start, start
    cost, damping = _pendulum_path(x, u, goal, dt, weight), 0.0
    for _ in range(iterations):
        p, q = 2 * weight * (x[-1, 0] - goal[0]), 2 * weight * (x[-1, 1] - goal[1])
        a, b, c = 2 * weight, 0.0, 2 * weight  # Hessian [[a, b], [b, c]] of the cost to go
        for k in range(steps - 1, -1, -1):
            fall = dt * np.cos(x[k, 0])  # dx' / dx = [[1, dt], [fall, 1]], dx' / du = [0, dt]
            by_u, by_uu = 2 * dt * u[k] + dt * q, 2 * dt + dt * dt * c
            by_u0, by_u1 = dt * (b + c * fall), dt * (b * dt + c)
            a, b, c = (
                a + 2 * b * fall + c * fall * fall,
                a * dt + b + fall * (b * dt + c),
                a * dt * dt + 2 * b * dt + c,
            )
            p, q = p + fall * q, dt * p + q
            heavy = by_uu + damping
            shift[k], gain[k, 0], gain[k, 1] = -by_u / heavy, -by_u0 / heavy, -by_u1 / heavy
            slope = by_u + by_uu * shift[k]
            p, q = (
                p + gain[k, 0] * slope + by_u0 * shift[k],
                q + gain[k, 1] * slope + by_u1 * shift[k],
            )
            a += gain[k, 0] * (2 * by_u0 + by_uu * gain[k, 0])
            b += gain[k, 0] * by_u1 + gain[k, 1] * by_u0 + by_uu * gain[k, 0] * gain[k, 1]
            c += gain[k, 1] * (2 * by_u1 + by_uu * gain[k, 1])
        size, gained = 1.0, 0.0
        for _ in range(8):
            new = 0.0
            for k in range(steps):
                away, off = trial[k, 0] - x[k, 0], trial[k, 1] - x[k, 1]
                v = u[k] + size * shift[k] + gain[k, 0] * away + gain[k, 1] * off
                trial_u[k] = v
                trial[k + 1, 0] = trial[k, 0] + dt * trial[k, 1]
                trial[k + 1, 1] = trial[k, 1] + dt * (np.sin(trial[k, 0]) + v)
                new += dt * v * v
            new += weight * ((trial[-1, 0] - goal[0]) ** 2 + (trial[-1, 1] - goal[1]) ** 2)
            if new < cost:
                gained = cost - new
                break
            size /= 2
        if gained > 0:
            x, trial, u, trial_u, cost = trial, x, trial_u, u, new
            damping = damping / 4 if damping > 1e-6 else 0.0
            if gained <= tolerance * cost:
                break
        else:
            damping = max(4 * damping, 0.02 * dt)
    return cost


@njit
def ilqr_batch(starts, goals, guesses, dt, weight, iterations, tolerance):  # type: ignore[no-untyped-def]
    """`ilqr` of each member: costs (B,)."""
    costs = np.empty(len(starts))
    for j in range(len(starts)):
        costs[j] = ilqr(starts[j], goals[j], guesses[j], dt, weight, iterations, tolerance)
    return costs
