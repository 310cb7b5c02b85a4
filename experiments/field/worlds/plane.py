"""Worlds in a plane: a point between two ellipses, and people's paths round a disc."""

from __future__ import annotations

from functools import partial

import numpy as np

from experiments.field.entries import Case, World
from experiments.field.worlds.continuous import Cells, box
from mlci.demonstrations import Demonstration
from mlci.demonstrator import Outcome, crossing, demonstrate, sample_trials
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import solve_safe_set
from mlci.safety.safety_filter import SafetyFilter
from mlci.shapes.balls import Ball
from mlci.spaces import Floats, StateSpace
from mlci.systems import FunctionSystem
from mlci.zoo.planar_point import PlanarPoint

POINT = PlanarPoint()
ELLIPSES = Regions.from_shapes(
    POINT.space,
    [Ball([-1.0, 0.6], [0.9, 0.6]), Ball([1.1, -0.7], [0.6, 1.0])],
    ("wide", "high"),
)

SQUARE = StateSpace(box([0.0, 0.0], [1.0, 1.0]), np.zeros(2, dtype=bool), ("x", "y"), ("m", "m"))
HAND = FunctionSystem(lambda x, u: (u[..., 0], u[..., 1]), SQUARE, box([-1.0, -1.0], [1.0, 1.0]))
CENTER, RADIUS = np.array([0.5, 0.5]), 0.1
DISC = Regions.from_shapes(SQUARE, [Ball(CENTER, [RADIUS, RADIUS])], ("disc",))
# The straightest path strays by sqrt(0.02 * 2 / 8) = 0.07 m halfway: most of a hypothesis.
ROUND = Cells(HAND, DISC, (20, 20), 7, 0.2, (10, 10), temperature=0.02)

DURATION, SAMPLE = 2.0, 0.02  # [s] of a reach, and between samples
NOISE, CLEARANCE = 0.15, 0.04  # deviation of a velocity as a share of it, [m] kept on average


def between(truth: Regions, seed: int, count: int) -> Case:
    """Optimal paths, of tasks whose straight way would enter what is forbidden."""
    safe = solve_safe_set(POINT, Grid(POINT.space, (61, 61)), truth)
    keep_out = SafetyFilter(POINT, safe, 0.05, 0.04, 0.05)  # a wide blend makes paths zigzag
    kept: list[Demonstration] = []
    tried = dropped = 0
    while len(kept) < count:
        trials = sample_trials(
            POINT,
            safe,
            POINT.space.bounds,
            trials=6 * count,  # all at once is the quickest, and mostly enough
            seed=seed,
            horizon=5.0,
            dt=0.05,
            first=tried,
            margin=0.04,
            restarts=12,
        )
        tried += len(trials)
        if through := crossing(POINT, trials, truth, dt=0.05, iterations=100):
            tries = demonstrate(POINT, through, truth, keep_out, dt=0.05, iterations=100)
            kept += [each.demonstration for each in tries if each.outcome is Outcome.KEPT]
            dropped += sum(each.outcome is not Outcome.KEPT for each in tries)
    cells = Cells(POINT, truth, (24, 24), 7, 0.5, (12, 12), temperature=0.1)
    return cells.case(kept[:count], dropped)


def around(seed: int, count: int) -> Case:
    """Paths that people might take round the disc, whose way across it would be the shortest."""
    rng, dropped = np.random.default_rng(seed), 0
    kept: list[Demonstration] = []
    while len(kept) < count:
        path = reach(rng)
        if DISC.violated_by(path)[0] or not np.all((path > 0) & (path < 1)):
            dropped += 1
        else:
            kept.append(Demonstration.from_path(path, SAMPLE))
    return ROUND.case(kept, dropped)


def reach(rng: np.random.Generator) -> Floats:
    """A path (K+1, 2) from one side of the disc to the other, with noise that grows with speed.

    Two minimum-jerk movements (Flash and Hogan 1985) of equal time, to a point beside the disc and
    on to the goal, the second begun before the first ends. Each velocity is scaled by noise whose
    deviation is a share of it (Harris and Wolpert 1998), correlated over 0.1 s; what it adds is
    removed linearly towards the goal, as by feedback.
    """
    angle = rng.uniform(0, 2 * np.pi)
    along, across = (
        np.array([np.cos(angle), np.sin(angle)]),
        np.array([-np.sin(angle), np.cos(angle)]),
    )
    start, goal = (
        CENTER + sign * rng.uniform(0.3, 0.42) * along + rng.uniform(-0.08, 0.08) * across
        for sign in (-1, 1)
    )
    side = 1.0 if rng.random() < 0.5 else -1.0
    via = CENTER + side * (RADIUS + CLEARANCE + 0.03 * rng.random()) * 1.25 * across
    time = np.arange(0.0, DURATION + SAMPLE / 2, SAMPLE) / DURATION
    first, second = (_minimum_jerk((time - begin) / 0.65) for begin in (0.0, 0.35))
    path = start + first[:, None] * (via - start) + second[:, None] * (goal - via)
    speed = np.diff(path, axis=0)
    smooth = np.ones(5) / np.sqrt(5)
    noise = np.stack([np.convolve(z, smooth, "same") for z in rng.normal(size=speed.T.shape)], -1)
    strayed = np.vstack([[0, 0], np.cumsum(NOISE * np.abs(speed) * noise, axis=0)])
    return path + strayed - time[:, None] * strayed[-1]


def _minimum_jerk(time: Floats) -> Floats:
    """Share of a movement that is done at a share of its time."""
    t = np.clip(time, 0.0, 1.0)
    return t**3 * (10 - 15 * t + 6 * t**2)


WORLDS = {
    "two ellipses": World(
        make=partial(between, ELLIPSES),
        demonstrations=16,
        source="our own, of the kind that work on continuous constraints demonstrates with",
        setting="tasks of 5 s; a point that moves as it is told, temperature 0.1, reward "
        "minus the squared speed, no discount; hard: no state inside; 24 x 24 cells, 49 actions, "
        "0.5 s, 144 hypotheses",
        differs="tasks are those whose straight way would enter an ellipse",
    ),
    "disc": World(
        make=around,
        demonstrations=20,
        source="after descriptions of people's reaches round an obstacle: 20 paths, a disc of "
        "radius 0.1 in the unit square; movements after Flash and Hogan 1985, noise after Harris "
        "and Wolpert 1998",
        setting="reaches of 2 s; temperature 0.02, reward minus the squared speed, no discount; "
        "hard: no state inside; 20 x 20 cells, 49 actions, 0.2 s, 100 hypotheses, none of which "
        "lies in the disc as a whole",
        differs="paths are simulated by our own rule, and those that enter the disc are made anew",
    ),
}
