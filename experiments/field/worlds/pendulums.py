"""The paper's two systems: the pendulum under C1 and under C2, and the telescoping pendulum."""

from __future__ import annotations

from functools import cache, partial

import numpy as np

from experiments.field.entries import Case, World
from experiments.field.worlds.continuous import Cells, box
from mlci.demonstrator import Attempt, Outcome, demonstrate, sample_trials
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.constant_controls import tabulate_escapes
from mlci.safety.reachability import SafeSet, solve_safe_set
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.spaces import Box
from mlci.systems import Pendulum, System, TelescopingPendulum

HORIZON, PI, FREE = 5.0, np.pi, np.inf
SWING, LEG = Pendulum(), TelescopingPendulum()
C1 = box([PI, 0.0], [1.2 * PI, 1.2])
C2 = box([1.6 * PI, 0.0], [1.8 * PI, 1.2])
PRACTICE = box([0.4 * PI, 0.0], [0.6 * PI, 1.2])  # of no world of the benchmark
PAIN = box([-0.3, -FREE, 7.2, -FREE], [0.3, FREE, 8.2, FREE])


def cells(system: System, forbidden: Box) -> Cells:
    """The table of one of the systems under a truth."""
    truth = Regions.from_boxes(system.space, [forbidden])
    if system is SWING:
        return Cells(system, truth, (20, 20), 9, 0.25, (10, 10))
    return Cells(system, truth, (10, 5, 10, 5), (5, 3), 1.0, (10, None, 10, None))


@cache
def safe_set(world: str) -> tuple[SafeSet, float]:
    """The states that can keep out of a truth, and the filter's margin."""
    system, forbidden, *_ = TASKS[world]
    truth = Regions.from_boxes(system.space, [forbidden])
    if system is SWING:
        safe = solve_safe_set(system, Grid(system.space, (121, 121)), truth)
        return safe, border_margin(system, safe, 0.02)
    grid = Grid(system.space, (41, 17, 27, 11))
    return tabulate_escapes(system, grid, truth, horizon=HORIZON), 0.1


def make(world: str, seed: int, count: int) -> Case:
    """Optimal demonstrations behind a safety filter, of random tasks.

    Raises:
        ValueError: fewer were kept than are to be shown.
    """
    system, forbidden, starts, offsets, restarts = TASKS[world]
    safe, margin = safe_set(world)
    truth = Regions.from_boxes(system.space, [forbidden])
    keep_out = SafetyFilter(system, safe, 0.02, margin)
    kept: list[tuple[int, Attempt]] = []
    tried, batch = 0, 2 * count
    while len(kept) < count:
        trials = sample_trials(
            system,
            safe,
            starts,
            trials=batch,
            seed=seed,
            horizon=HORIZON,
            dt=0.02,
            first=tried,
            margin=margin,
            goal_offsets=offsets,
            restarts=restarts,
        )
        attempts = demonstrate(system, trials, truth, keep_out, dt=0.02)
        kept += [(tried + k, a) for k, a in enumerate(attempts) if a.outcome is Outcome.KEPT]
        tried += batch
        if tried > 10 * count and not kept:
            raise ValueError(f"{world}: none of {tried} demonstrations was kept")
    last = kept[count - 1][0]
    return cells(system, forbidden).case(
        [a.demonstration for _, a in kept[:count]], last + 1 - count
    )


_POSTURES = box([-0.8, 0.0, 5.3, 0.0], [0.8, 0.0, 10.7, 0.0])
_ANY_SPEED = box([-0.1, -FREE, -0.3, -FREE], [0.1, FREE, 0.3, FREE])
_ANYWHERE = box([0.0, -2.0], [2 * PI, 2.0])
# System, what is forbidden, where tasks start, offsets of goals, restarts.
TASKS = {
    "practice": (SWING, PRACTICE, _ANYWHERE, None, 3),
    "pendulum C1": (SWING, C1, _ANYWHERE, None, 3),
    "pendulum C2": (SWING, C2, _ANYWHERE, None, 3),
    "telescoping pendulum": (LEG, PAIN, _POSTURES, _ANY_SPEED, 8),
}
_SETTING = (
    "tasks of 5 s between {tasks}; temperature 1, reward minus the squared controls, no discount; "
    "hard: no state inside at any time, of the motion and not of cells alone"
)
_SOURCE = "Stocking, McPherson, Matthew and Tomlin, Discretizing Dynamics for Maximum Likelihood "
WORLDS = {
    f"pendulum {name}": World(
        make=partial(make, f"pendulum {name}"),
        demonstrations=20,
        source=_SOURCE + f"Constraint Inference: section V, {name}; 20 x 20 cells, 9 actions, "
        "0.25 s, 100 hypotheses",
        setting=_SETTING.format(tasks="random safe states of at most 2 rad/s"),
        differs="demonstrations by iLQR behind a safety filter of ours, with its margin; theirs "
        "are 65",
    )
    for name in ("C1", "C2")
} | {
    "telescoping pendulum": World(
        make=partial(make, "telescoping pendulum"),
        demonstrations=20,
        source=_SOURCE + "Constraint Inference: section VI; 2500 cells, 15 actions, 100 hypotheses",
        setting=_SETTING.format(tasks="random postures, from rest"),
        differs="range, units and truth are ours, since the paper gives none; the truth lies "
        "across hypotheses, two of which it covers; steps of 1 s, so that cells can be left; their "
        "demonstrations are 5",
    )
}
