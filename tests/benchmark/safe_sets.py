"""Safe sets whose borders are known in closed form, and who finds them.

Everybody returns V (S,) at the cell centres of one grid.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import solve_safe_set
from mlci.spaces import Bools, Box, Floats
from mlci.systems import Pendulum, System, TelescopingPendulum
from tests.benchmark import loops
from tests.benchmark.contest import OURS, Contender, Contest, Work

PENDULUM, TELESCOPE = Pendulum(), TelescopingPendulum()
C1 = Regions(PENDULUM.space, [[np.pi, 0.0]], [[1.2 * np.pi, 1.2]])  # type: ignore[arg-type]
_FREE = np.inf
LENGTHS = Regions(  # of the leg, at any angle and velocity
    TELESCOPE.space,
    [[-_FREE, -_FREE, 7.2, -_FREE]],  # type: ignore[arg-type]
    [[_FREE, _FREE, 8.2, _FREE]],  # type: ignore[arg-type]
)


def pendulum_is_doomed(states: Floats) -> Bools:
    """Whether states (B, 2) cannot stay out of C1: between the arcs of energy through its left
    corners, or inside it (derived in tests/mlci/test_reachability.py)."""
    angle, velocity = states.T
    energy = velocity**2 / 2 + np.cos(angle)
    cannot_stop = energy + 2 * angle > -1 + 2 * np.pi
    cannot_rise = energy - 2 * angle < 1.2**2 / 2 - 1 - 2 * np.pi
    before = (angle <= np.pi) & (velocity > 0) & cannot_stop & cannot_rise
    return np.asarray(before | (C1.signed_distance(states) < 0))


def leg_is_doomed(states: Floats) -> Bools:
    """Whether states (B, 4) cannot stay out of the lengths: who comes towards them needs
    velocity^2 / (2 x 3) to stop."""
    length, velocity = states[:, 2], states[:, 3]
    way = velocity**2 / 6
    below, above = length + way * (velocity > 0), length - way * (velocity < 0)
    return (
        ((length <= 7.2) & (below > 7.2))
        | ((length >= 8.2) & (above < 8.2))
        | ((length > 7.2) & (length < 8.2))
    )


def contests() -> Iterator[Contest]:
    """In two dimensions at two sizes, and in four."""
    rng = np.random.default_rng(0)
    near = rng.uniform([np.pi - 1.0, -0.5], [1.2 * np.pi + 0.2, 2.0], (100_000, 2))
    for count in (101, 201):
        grid = Grid(PENDULUM.space, (count, count))
        yield _contest("pendulum", PENDULUM, grid, C1, near, pendulum_is_doomed(near), 0.6)
    bounds = TELESCOPE.space.bounds
    states = rng.uniform(bounds.lower, bounds.upper, (100_000, 4))
    grid = Grid(TELESCOPE.space, (21,) * 4)
    doomed = leg_is_doomed(states)
    yield _contest("telescope", TELESCOPE, grid, LENGTHS, states, doomed, 1.0)


def _contest(
    name: str,
    system: System,
    grid: Grid,
    keep_out: Regions,
    states: Floats,
    doomed: Bools,
    tau: float,
) -> Contest:
    """Who finds the safe set; this project stops by itself, others are told when to: at tau [s]."""

    def error(values: Floats) -> float:
        """Area that is wrongly classed, as a share of the doomed area."""
        wrong = (grid.interpolate(values, states) < 0) != doomed
        return float(np.sum(wrong) / np.sum(doomed))

    def ours() -> Work:
        return lambda: solve_safe_set(system, grid, keep_out).values

    rivals = [
        Contender(f"hj-reachability, {accuracy}", _hj(system, grid, keep_out, tau, accuracy))
        for accuracy in ("medium", "high", "very_high")
    ]
    plain = Contender("plain compiled loops", _loops(system, grid, keep_out, tau))
    student = [Contender("plain numpy, first order", _student(system, grid, keep_out, tau))]
    return Contest(
        "safe set",
        f"{name}, {' x '.join(map(str, grid.shape))}",
        [Contender(OURS, ours), *rivals, plain, *(student if grid.size < 1e5 else [])],
        error,
        None,
        "wrong area / doomed area",
    )


def _hj(system: System, grid: Grid, keep_out: Regions, tau: float, accuracy: str) -> Any:
    """hj-reachability: the same equation, backwards in time."""

    def prepare() -> Work:
        import jax

        jax.config.update("jax_enable_x64", True)
        import hj_reachability as hj
        import jax.numpy as jnp

        class Dynamics(hj.ControlAndDisturbanceAffineDynamics):
            """Affine in the control, as both pendulums are: h = f(x) + B u."""

            def __init__(self) -> None:
                box, none = system.control_box, np.zeros(1)
                super().__init__(
                    "max", "min", hj.sets.Box(box.lower, box.upper), hj.sets.Box(none, none)
                )

            def open_loop_dynamics(self, state: Any, time: float) -> Any:
                if system is TELESCOPE:
                    swing = TELESCOPE.gravity / state[2] * jnp.sin(state[0])
                    return jnp.array([state[1], swing, state[3], 0.0])
                return jnp.array([state[1], jnp.sin(state[0])])

            def control_jacobian(self, state: Any, time: float) -> Any:
                n = len(grid.shape)
                return jnp.eye(n)[:, 1::2]

            def disturbance_jacobian(self, state: Any, time: float) -> Any:
                return jnp.zeros((len(grid.shape), 1))

        centers = grid.centers.reshape(*grid.shape, -1)
        lower, upper = grid.centers[0], grid.centers[-1]
        around = np.flatnonzero(grid.space.periodic)
        upper = upper + grid.widths * grid.space.periodic
        theirs = hj.Grid.from_lattice_parameters_and_boundary_conditions(
            hj.sets.Box(lower, upper),
            grid.shape,
            boundary_conditions=None,
            periodic_dims=tuple(around.tolist()) or None,
        )
        np.testing.assert_allclose(theirs.states, centers, atol=1e-9)
        settings = hj.SolverSettings.with_accuracy(
            accuracy, hamiltonian_postprocessor=hj.solver.backwards_reachable_tube
        )
        start = jnp.asarray(keep_out.signed_distance(grid.centers).reshape(grid.shape))
        dynamics = Dynamics()

        def work() -> Floats:
            values = hj.step(settings, dynamics, theirs, 0.0, start, -tau, progress_bar=False)
            return np.asarray(values).ravel()

        return work

    return prepare


def _loops(system: System, grid: Grid, keep_out: Regions, tau: float) -> Any:
    """The project's scheme over the whole grid, as plain loops."""

    def prepare() -> Work:
        def work() -> Floats:
            velocities = np.stack(
                [
                    system.dynamics(grid.centers, u) / grid.widths
                    for u in _corners(system.control_box)
                ]
            )
            fastest = np.max(np.sum(np.max(np.abs(velocities), axis=0), axis=1))
            steps = int(np.ceil(tau * fastest / 0.8))
            distance = keep_out.signed_distance(grid.centers)
            bend = -distance.min() * max(1.0, -distance.min() / (2.0 * grid.widths.min()))
            bent = np.where(distance < 0, -bend * np.expm1(-distance / bend), distance)
            values = loops.upwind(
                bent,
                np.ascontiguousarray(velocities),
                np.array(grid.shape),
                grid.space.periodic,
                tau / steps,
                steps,
            )
            return np.where(values < 0, -bend * np.log1p(-np.minimum(values, 0) / bend), values)

        return work

    return prepare


def _student(system: System, grid: Grid, keep_out: Regions, tau: float) -> Any:
    """Upwind at first order with explicit steps, as the textbook has it."""

    def prepare() -> Work:
        def work() -> Floats:
            shape = grid.shape
            rates = [
                (system.dynamics(grid.centers, u) / grid.widths).reshape(*shape, -1)
                for u in _corners(system.control_box)
            ]
            fastest = np.max(
                sum(np.max(np.abs([r[..., d] for r in rates]), axis=0) for d in range(len(shape)))
            )
            steps = int(np.ceil(tau * fastest / 0.9))
            values = keep_out.signed_distance(grid.centers).reshape(shape)
            for _ in range(steps):
                best = np.full(shape, -np.inf)
                right, left = [], []
                for d in range(len(shape)):
                    ends = [(1, 1) if k == d else (0, 0) for k in range(len(shape))]
                    mode = "wrap" if grid.space.periodic[d] else "edge"
                    difference = np.diff(np.pad(values, ends, mode=mode), axis=d)
                    left.append(np.delete(difference, -1, axis=d))
                    right.append(np.delete(difference, 0, axis=d))
                for rate in rates:
                    total = np.zeros(shape)
                    for d in range(len(shape)):
                        total += rate[..., d] * np.where(rate[..., d] > 0, right[d], left[d])
                    best = np.maximum(best, total)
                values = values + tau / steps * np.minimum(best, 0.0)
            return values.ravel()

        return work

    return prepare


def _corners(box: Box) -> Floats:
    """The extremal controls."""
    return box.vertices()
