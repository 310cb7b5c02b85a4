"""The reward of a recorded path: by inverse dynamics, where its controls are not known."""

from __future__ import annotations

import numpy as np

from mlci.demonstrations import Demonstration
from mlci.simulate import RK4
from mlci.spaces import Floats
from mlci.systems import System

_ITERATIONS = 10  # one is enough where the control enters linearly
_GUESSES = 5  # values of each control from which the search may begin


def controls_along(system: System, states: Floats, times: Floats) -> Floats:
    """Controls (K, m) that lead from each sample of a path to the next, as nearly as any do.

    Least squares by Gauss-Newton steps, over the difference of a Runge-Kutta step from the next
    sample in parts of the state space's widths. They may exceed the control box.

    Args:
        system: the dynamics.
        states: (K+1, n) path.
        times: (K+1,) of the samples [s].
    """
    before, after, dt = states[:-1], states[1:], np.diff(times)[:, None]
    widths, box = system.space.bounds.widths, system.control_box

    def difference(controls: Floats) -> Floats:
        """(..., K, n) how far the next samples are from what controls (..., K, m) lead to."""
        return system.space.difference(after, RK4.step(system, before, controls, dt)) / widths

    ticks = np.linspace(box.lower, box.upper, _GUESSES).T
    guesses = np.stack([part.ravel() for part in np.meshgrid(*ticks)], axis=-1)
    misses = [
        np.linalg.norm(difference(np.tile(guess, (len(before), 1))), axis=1) for guess in guesses
    ]
    controls, miss = guesses[np.argmin(misses, axis=0)], np.min(misses, axis=0)
    for _ in range(_ITERATIONS):
        _, by_control = RK4.rate_jacobians(system, before, controls, dt)
        inverse = np.linalg.pinv(by_control * dt[..., None] / widths[:, None])
        moved = controls + np.einsum("kij,kj->ki", inverse, difference(controls))
        moved_miss = np.linalg.norm(difference(moved), axis=1)
        better = moved_miss < miss
        controls = np.where(better[:, None], moved, controls)
        miss = np.where(better, moved_miss, miss)
        if not better.any():
            break
    return controls


def path_reward(system: System, demonstration: Demonstration, steps: int) -> float:
    """What a recorded path earns an agent that holds each control for one of T equal steps.

    The recorded controls, or else those of `controls_along`, are averaged over each step: that is
    the held control with the same effect on a velocity, and it averages away what noise adds from
    sample to sample. The reward is that of the state in which the step begins, as in the tabular
    model.

    Args:
        system: the dynamics and the running reward r.
        demonstration: the path.
        steps: T.

    Returns:
        The reward at temperature 1 [nat].
    """
    states, controls = demonstration.states, demonstration.controls
    times = demonstration.times
    if controls is None:
        controls = controls_along(system, states, times)
    edges, step = np.linspace(0, times[-1], steps + 1), times[-1] / steps
    effects = controls * np.diff(times)[:, None]
    sums = np.cumsum(np.vstack([np.zeros(controls.shape[1]), effects]), axis=0)
    held = np.diff(_between(times, sums, edges), axis=0) / step
    reward = system.running_reward(_between(times, states, edges[:-1]), held)
    return float(np.sum(np.broadcast_to(reward, steps)) * step)


def _between(times: Floats, values: Floats, wanted: Floats) -> Floats:
    """(Q, d) values (K+1, d) at times (K+1,), interpolated linearly at others (Q,)."""
    return np.column_stack([np.interp(wanted, times, column) for column in values.T])
