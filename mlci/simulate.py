"""Simulation under a control that is held between samples (zero-order hold)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.spaces import Floats
from mlci.systems import System

Seconds = float | Floats  # one time step for all, or (..., 1) of each state
Step = Callable[[System, Floats, Floats, Seconds], Floats]
StepJacobians = Callable[[System, Floats, Floats, Seconds], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Integrator:
    """How a state moves on under a held control, and how that depends on both.

    Attributes:
        step: states (..., n) and controls (..., m) to states (..., n) after dt.
        rate_jacobians: derivatives of the mean rate (x' - x) / dt of a step from x to x': by the
            state (..., n, n), and by the control (..., n, m).
    """

    step: Step
    rate_jacobians: StepJacobians


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


def euler_step(system: System, states: Floats, controls: Floats, dt: Seconds) -> Floats:
    """One explicit Euler step: states (..., n) after dt [s], first order."""
    return states + dt * system.dynamics(states, controls)


def rk4_step(
    system: System, states: Floats, controls: Floats, dt: Seconds, rates: Floats | None = None
) -> Floats:
    """One classical Runge-Kutta step: states (..., n) after dt [s], fourth order.

    The rates (..., n) with which it begins may be known.
    """
    k1 = system.dynamics(states, controls) if rates is None else rates
    k2 = system.dynamics(states + dt / 2 * k1, controls)
    k3 = system.dynamics(states + dt / 2 * k2, controls)
    k4 = system.dynamics(states + dt * k3, controls)
    return states + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def euler_rate_jacobians(
    system: System, states: Floats, controls: Floats, _dt: Seconds
) -> tuple[Floats, Floats]:
    """dh/dx and dh/du: the rate of an Euler step is that of its start."""
    return system.jacobians(states, controls)


def rk4_rate_jacobians(
    system: System, states: Floats, controls: Floats, dt: Seconds
) -> tuple[Floats, Floats]:
    """Derivatives of the mean rate of a Runge-Kutta step, stage by stage by the chain rule."""
    stage = system.dynamics(states, controls)
    by_state, by_control = system.jacobians(states, controls)
    sums = [by_state, by_control]
    for reach, weight in ((dt / 2, 2), (dt / 2, 2), (dt, 1)):
        drift, push = system.jacobians(states + reach * stage, controls)
        stage = system.dynamics(states + reach * stage, controls)
        of_matrix = np.expand_dims(reach, -1)
        by_state = drift + of_matrix * (drift @ by_state)
        by_control = push + of_matrix * (drift @ by_control)
        sums = [sums[0] + weight * by_state, sums[1] + weight * by_control]
    return sums[0] / 6, sums[1] / 6


EULER = Integrator(euler_step, euler_rate_jacobians)
RK4 = Integrator(rk4_step, rk4_rate_jacobians)


def in_substeps(integrator: Integrator, count: int) -> Integrator:
    """The integrator that takes `count` equal steps of another for each of its own."""

    def step(system: System, states: Floats, controls: Floats, dt: Seconds) -> Floats:
        for _ in range(count):
            states = integrator.step(system, states, controls, dt / count)
        return states

    def rate_jacobians(
        system: System, states: Floats, controls: Floats, dt: Seconds
    ) -> tuple[Floats, Floats]:
        part, of_matrix = dt / count, np.expand_dims(dt / count, -1)
        by_state, by_control = integrator.rate_jacobians(system, states, controls, part)
        by_state, by_control = of_matrix * by_state, of_matrix * by_control  # of x' - x, so far
        for _ in range(count - 1):
            states = integrator.step(system, states, controls, part)
            drift, push = integrator.rate_jacobians(system, states, controls, part)
            by_control = by_control + of_matrix * (drift @ by_control + push)
            by_state = by_state + of_matrix * (drift + drift @ by_state)
        return by_state / (of_matrix * count), by_control / (of_matrix * count)

    return Integrator(step, rate_jacobians)


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
    controls, start = np.asarray(controls, dtype=float), np.asarray(start, dtype=float)
    # Each dimension is contiguous: numpy is slow along an axis as short as that of dimensions.
    states = np.moveaxis(np.ascontiguousarray(np.moveaxis(start, -1, 0)), 0, -1)
    batch = np.broadcast_shapes(start.shape[:-1], controls.shape[:-2])
    path = np.empty((controls.shape[-2] * substeps + 1, start.shape[-1], *batch))
    path[0] = np.moveaxis(np.broadcast_to(states, (*batch, start.shape[-1])), -1, 0)
    for number in range(1, len(path)):
        control = controls[..., (number - 1) // substeps, :]
        states = step(system, states, control, dt / substeps)
        path[number] = np.moveaxis(states, -1, 0)
    return np.moveaxis(path, (0, 1), (-2, -1))
