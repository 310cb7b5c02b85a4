"""Time the main algorithms against floors that no implementation in numpy could beat by much.

Run with `make benchmark`. Each row is the median of several runs on one thread. A floor is a
measured rate of this machine (bytes copied, or calls of the system's own functions) times the
bytes or calls that the algorithm cannot do without.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import platform
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy

from mlci.constraints import ConstraintSet
from mlci.demonstrator import demonstrate, sample_trials
from mlci.grids import Grid
from mlci.maxent import log_partition, policy, violation_probabilities
from mlci.mdp import TabularMDP, action_grid, discretize, substep_count
from mlci.reachability import solve
from mlci.safety_filter import SafetyFilter, border_margin
from mlci.simulate import rk4_step
from mlci.spaces import Box, Floats
from mlci.systems import Pendulum

SYSTEM = Pendulum()
HYPOTHESES = ConstraintSet.from_grid(SYSTEM.space, (10, 10))
TRUTH = ConstraintSet(SYSTEM.space, [[np.pi, 0.0]], [[1.2 * np.pi, 1.2]])  # type: ignore[arg-type]


def median_seconds(work: Callable[[], object], runs: int = 7) -> float:
    """Median wall time of a call, after one that does not count."""
    work()
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return float(np.median(times))


def copy_rate(size: int) -> float:
    """Bytes per second of a copy, read and written bytes counted, of an array of `size` bytes."""
    source = np.ones(size // 8)
    target = np.empty_like(source)
    repeats = max(1, (1 << 26) // size)
    return (
        2
        * size
        * repeats
        / median_seconds(lambda: [np.copyto(target, source) for _ in range(repeats)])
    )


def phi_floor(mdp: TabularMDP, log_z: Floats) -> float:
    """Seconds to read each merged successor's row of Phi and to write each row, once a step."""
    traffic = 0
    for t in range(len(log_z) - 1):
        cells, _ = policy(mdp, log_z, t)
        traffic += int(np.sum(mdp.by_successor[2][cells])) + len(cells)
    return traffic * mdp.crosses.shape[1] * 8 / copy_rate(1 << 19)


def inference_rows(cells: int, dt: float, samples: int) -> list[tuple[str, float, float]]:
    """Discretisation, soft Bellman backup and violation probabilities of one task."""
    grid, actions = Grid(SYSTEM.space, (cells, cells)), action_grid(SYSTEM, 9)
    label = f"{grid.size} cells x 9 actions, dt {dt:g}, samples {samples}"
    mdp = discretize(SYSTEM, grid, actions, dt, HYPOTHESES, samples)
    steps = round(5 / dt)
    start, goal = int(grid.index([0.5, 0.0])), grid.cells_in(Box.point([3.0, 0.0]))
    log_z = log_partition(mdp, start, goal, steps)
    violation_probabilities(mdp, log_z, start)  # fills the caches that all tasks share
    points = np.repeat(grid.centers, mdp.moves, axis=0)
    held = actions[np.tile(mdp.action, grid.size)]
    entries = sum(len(np.flatnonzero(row > -np.inf)) for row in log_z) * mdp.moves
    return [
        (
            f"discretize: {label}; floor: its Runge-Kutta steps",
            median_seconds(lambda: discretize(SYSTEM, grid, actions, dt, HYPOTHESES, samples), 3),
            substep_count(SYSTEM, grid, actions, dt)
            * median_seconds(lambda: rk4_step(SYSTEM, points, held, dt)),
        ),
        (
            f"log_partition: {label}; floor: one exp for each active move",
            median_seconds(lambda: log_partition(mdp, start, goal, steps)),
            median_seconds(lambda: np.exp(np.full(entries, -1.0))),
        ),
        (
            f"violation_probabilities: {label}; floor: traffic of Phi",
            median_seconds(lambda: violation_probabilities(mdp, log_z, start)),
            phi_floor(mdp, log_z),
        ),
    ]


def demonstrator_rows() -> list[tuple[str, float, float]]:
    """Safe set, and 100 tasks x 3 restarts of iLQR with the filter."""
    grid = Grid(SYSTEM.space, (201, 201))
    omega = solve(SYSTEM, grid, TRUTH)
    margin = border_margin(SYSTEM, omega, 0.01)
    box = Box(np.array([0.0, -2.0]), np.array([2 * np.pi, 2.0]))
    trials = sample_trials(
        SYSTEM, omega, box, trials=100, seed=0, horizon=5.0, dt=0.01, margin=margin
    )
    safety = SafetyFilter(SYSTEM, omega, 0.01, margin)
    batch = np.zeros((8 * 300, 2)), np.zeros((8 * 300, 1))
    calls = 500 * 10  # eight step sizes of all restarts, at each time step of each iteration
    return [
        (
            "safe set, 201 x 201, to convergence",
            median_seconds(lambda: solve(SYSTEM, grid, TRUTH), 3),
            np.nan,
        ),
        (
            "iLQR, 100 tasks x 3 restarts x 10 iterations; floor: its dynamics and filter calls",
            median_seconds(
                lambda: demonstrate(SYSTEM, trials, TRUTH, safety, dt=0.01, goal_weight=300.0), 1
            ),
            calls * median_seconds(lambda: (SYSTEM.dynamics(*batch), safety.apply(*batch)), 25),
        ),
    ]


def main() -> None:
    """Print the table."""
    names = [
        line for line in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line
    ]
    cpu = names[0].split(":")[1].strip() if names else platform.processor()
    print(f"{cpu}, {os.cpu_count()} cores, one thread used; Python {platform.python_version()}, ")
    print(f"numpy {np.__version__}, scipy {scipy.__version__}\n")
    print(f"{'median [ms]':>12} {'floor [ms]':>11} {'ratio':>6}  what")
    rows = [
        *inference_rows(20, 0.25, 1),
        *inference_rows(40, 0.25, 1),
        *inference_rows(20, 0.25, 3),
        *demonstrator_rows(),
    ]
    for label, seconds, floor in rows:
        ratio = f"{seconds / floor:6.1f}" if floor == floor else "     -"
        bound = f"{1e3 * floor:11.2f}" if floor == floor else "          -"
        print(f"{1e3 * seconds:12.2f} {bound} {ratio}  {label}")


if __name__ == "__main__":
    main()
