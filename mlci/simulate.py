"""Simulation under a control that is held between samples (zero-order hold)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from mlci.spaces import Floats
from mlci.systems import System

Step = Callable[[System, Floats, Floats, float], Floats]


def step_count(horizon: float, dt: float, tolerance: float = 1e-9) -> int:
    """T = horizon / dt, the number of transitions.

    Args:
        horizon: duration [s].
        dt: time step [s].
        tolerance: how far the horizon may be from a whole number of steps, as a share of one.

    Raises:
        ValueError: dt does not divide the horizon.
    """
    steps = round(horizon / dt)
    if steps < 1 or abs(steps * dt - horizon) > tolerance * dt:
        raise ValueError(f"a time step of {dt} s does not divide the horizon of {horizon} s")
    return steps


def euler_step(system: System, states: Floats, controls: Floats, dt: float) -> Floats:
    """One explicit Euler step: states (..., n) after dt [s], first order."""
    return states + dt * system.dynamics(states, controls)


def rk4_step(system: System, states: Floats, controls: Floats, dt: float) -> Floats:
    """One classical Runge-Kutta step: states (..., n) after dt [s], fourth order."""
    k1 = system.dynamics(states, controls)
    k2 = system.dynamics(states + dt / 2 * k1, controls)
    k3 = system.dynamics(states + dt / 2 * k2, controls)
    k4 = system.dynamics(states + dt * k3, controls)
    return states + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def rollout(
    system: System,
    start: ArrayLike,
    controls: ArrayLike,
    dt: float,
    substeps: int = 1,
    step: Step = rk4_step,
) -> Floats:
    """Simulate a sequence of held controls.

    Args:
        start: (..., n) first states.
        controls: (..., K, m) controls, each held for dt.
        dt: hold time [s].
        substeps: integrator steps in a hold.
        step: the integrator.

    Returns:
        (..., K * substeps + 1, n) states, not wrapped: the path of a periodic dimension is
        continuous.
    """
    controls = np.asarray(controls, dtype=float)
    states = [np.asarray(start, dtype=float)]
    for k in range(controls.shape[-2]):
        for _ in range(substeps):
            states.append(step(system, states[-1], controls[..., k, :], dt / substeps))
    return np.stack(np.broadcast_arrays(*states), axis=-2)
