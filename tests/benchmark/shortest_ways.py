"""How much four optimal detours can tell of two ellipses: python -m tests.benchmark.shortest_ways

An answer to the study `areas` from outside: in a plane where one moves as one likes, whatever costs
|u|^2 for a fixed time costs least along the shortest way at even speed, and the shortest way round
ellipses is found on a graph of points that see each other. Nothing here uses cells or trajectories
that are drawn, and no code of the library but that which picks the area to name.

Two questions. What do the study's demonstrators spend beyond the shortest way round the truth? And
if somebody went these ways exactly, what would be known of the truth? The posterior of two ellipses
that do not meet, places and half widths uniform as in the study, is sampled by parallel tempering:
a demonstration weighs exp(-(its cost - the least under the ellipses) / temperature), and excludes
ellipses that it enters. The area with the largest expected overlap is scored; what it expects, and
whether two runs agree, shows whether the posterior can be believed.

Tables of results/shortest_ways: `costs`, a row a kept demonstration of the study; `overlaps`, a row
a set of tasks: `overlap`, what was `expected`, and `alike`, the overlap of the areas of two runs;
`summary`, means of the latter with Student's 95 % interval over seeds, and quantiles of cost by
least. `--results DIR` names another folder of results.
"""

from __future__ import annotations

from tests.benchmark import timing  # before numpy, which is told to use one thread

# isort: split

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numba
import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from experiments.field.leaderboard import interval
from experiments.point.trials import demonstrations
from experiments.tracking.files import csv_bytes, digest, replace_file
from experiments.tracking.store import Store
from experiments.tracking.study import collated, write_collated
from mlci.areas.overlap import best_area
from tests.benchmark.configs import composed

SEEDS, SUBSETS = range(1, 11), 2  # the first seeds of the study
HALF, SMALLEST, LARGEST = 3.0, 0.48, 1.2  # [m] the plane's half width, ellipses' half widths
TEMPERATURE = 0.01  # of |u|^2 times a second
RUNS, KEPT = 2, 1000
STEPS = {4: 200_000, 8: 60_000}  # of each chain, by the number of ways: few leave more open
COLD = np.array([1, 0.4, 0.16, 0.06, 0.025, 0.01, 0.003])  # powers of the likelihood
_FINE, _COARSE = 64, 16  # points on an ellipse, of demonstrations and of hypotheses
_SIDE = 48  # of the raster

njit = numba.njit(cache=True, error_model="numpy")


@njit
def _blocks(p, q, ellipse, level):
    """Whether the way straight from p to q enters an ellipse (4,), centre and half widths."""
    x, y = (p[0] - ellipse[0]) / ellipse[2], (p[1] - ellipse[1]) / ellipse[3]
    dx, dy = (q[0] - p[0]) / ellipse[2], (q[1] - p[1]) / ellipse[3]
    length = dx * dx + dy * dy
    share = 0.0 if length == 0 else min(1.0, max(0.0, -(x * dx + y * dy) / length))
    return (x + share * dx) ** 2 + (y + share * dy) ** 2 < level


@njit
def _distance(p, q):
    return np.hypot(q[0] - p[0], q[1] - p[1])


@njit
def shortest(start, goal, ellipses, count):
    """The shortest way (K, 2) round ellipses (E, 4) from start to goal, empty if there is none.

    A* on start, goal and `count` points round each ellipse, at a distance from it
    that makes the polygon as long as the ellipse.
    """
    turn = np.pi / count
    swell = turn / np.sin(turn)
    level = (swell * np.cos(turn)) ** 2 - 1e-9
    points = np.empty((2 + count * len(ellipses), 2))
    points[0], points[1] = start, goal
    for e in range(len(ellipses)):
        for i in range(count):
            at = 2 + e * count + i
            points[at, 0] = ellipses[e, 0] + swell * ellipses[e, 2] * np.cos(2 * turn * i)
            points[at, 1] = ellipses[e, 1] + swell * ellipses[e, 3] * np.sin(2 * turn * i)
    size = len(points)
    length, before = np.full(size, np.inf), np.full(size, -1)
    done = np.zeros(size, dtype=numba.boolean)
    length[0] = 0.0
    while True:
        here, nearest = -1, np.inf
        for i in range(size):
            ahead = length[i] + _distance(points[i], goal)
            if not done[i] and (here < 0 or ahead < nearest):
                here, nearest = i, ahead
        if nearest == np.inf:
            return np.empty((0, 2))
        if here == 1:
            break
        done[here] = True
        for i in range(size):
            reach = length[here] + _distance(points[here], points[i])
            outside = abs(points[i, 0]) > HALF or abs(points[i, 1]) > HALF
            if done[i] or reach >= length[i] or outside:
                continue
            free = True
            for e in range(len(ellipses)):
                free = free and not _blocks(points[here], points[i], ellipses[e], level)
            if free:
                length[i], before[i] = reach, here
    steps, at = 1, 1
    while before[at] >= 0:
        steps, at = steps + 1, before[at]
    way, at = np.empty((steps, 2)), 1
    for k in range(steps):
        way[steps - 1 - k], at = points[at], before[at]
    return way


@njit
def length(way):
    total = 0.0 if len(way) else np.inf
    for k in range(len(way) - 1):
        total += _distance(way[k], way[k + 1])
    return total


@njit
def _log_likelihood(ellipses, ways, costs, duration):
    """Of ways (N, K, 2) at points that lie close, and of their costs (N,)."""
    for j in range(len(ways)):
        for e in range(len(ellipses)):
            x = (ways[j, :, 0] - ellipses[e, 0]) / ellipses[e, 2]
            y = (ways[j, :, 1] - ellipses[e, 1]) / ellipses[e, 3]
            if np.min(x * x + y * y) < 0.96:  # what coarse polygons and points between allow
                return -np.inf
    total = 0.0
    for j in range(len(ways)):
        least = length(shortest(ways[j, 0], ways[j, -1], ellipses, _COARSE)) ** 2 / duration
        total += min(0.0, (least - costs[j]) / TEMPERATURE)
    return total


@njit
def _possible(ellipses):
    """Whether two ellipses are of the prior: in the plane, of its sizes, and apart."""
    for e in range(2):
        if max(abs(ellipses[e, 0]), abs(ellipses[e, 1])) > HALF:
            return False
        if min(ellipses[e, 2], ellipses[e, 3]) < SMALLEST:
            return False
        if max(ellipses[e, 2], ellipses[e, 3]) > LARGEST:
            return False
    for i in range(24):
        angle = 2 * np.pi * i / 24
        for share in (0.0, 0.5, 1.0):
            x = ellipses[0, 0] + share * ellipses[0, 2] * np.cos(angle) - ellipses[1, 0]
            y = ellipses[0, 1] + share * ellipses[0, 3] * np.sin(angle) - ellipses[1, 1]
            if (x / ellipses[1, 2]) ** 2 + (y / ellipses[1, 3]) ** 2 < 1:
                return False
    return True


@njit
def _draw(rng, ellipse):
    """Draw an ellipse (4,) of the prior, in place."""
    for d in range(2):
        ellipse[d] = rng.uniform(-HALF, HALF)
        ellipse[2 + d] = rng.uniform(SMALLEST, LARGEST)


@njit
def _moved(rng, ellipses):
    """Symmetric: one ellipse drawn anew, or numbers moved a little, or one side of it moved."""
    new, e = ellipses.copy(), rng.integers(0, 2)
    size, kind = 0.02 * 10 ** rng.uniform(0.0, 1.5), rng.uniform(0.0, 1.0)
    if kind < 0.15:
        _draw(rng, new[e])
    elif kind < 0.4:
        for i in range(4):
            new[e, i] += size * rng.standard_normal()
    else:
        d, shift = rng.integers(0, 2), size * rng.standard_normal()
        new[e, d] += shift if rng.integers(0, 2) else -shift
        new[e, 2 + d] += shift
    return new


@njit
def sample(rng, steps, ways, costs, duration):
    """Ellipses (KEPT, 2, 4) of the last half of the chain that is cold.

    Parallel tempering: a chain each temperature, which start at the best of many draws, of which
    at least one is possible, and of which neighbours exchange their states.
    """
    count = len(COLD)
    here, value = np.empty((count, 2, 4)), np.full(count, -np.inf)
    tries = 0
    while tries < 3000 or value[0] == -np.inf:
        tries += 1
        new = np.empty((2, 4))
        _draw(rng, new[0])
        _draw(rng, new[1])
        found = _log_likelihood(new, ways, costs, duration) if _possible(new) else -np.inf
        if found > value[0]:
            value[:], here[:] = found, new
    kept = np.empty((KEPT, 2, 4))
    for step in range(steps):
        for c in range(count):
            new = _moved(rng, here[c])
            if not _possible(new):
                continue
            found = _log_likelihood(new, ways, costs, duration)
            if np.log(rng.uniform(0.0, 1.0)) < COLD[c] * (found - value[c]):
                here[c], value[c] = new, found
        c = rng.integers(0, count - 1)
        gain = (COLD[c] - COLD[c + 1]) * (value[c + 1] - value[c])
        if np.log(rng.uniform(0.0, 1.0)) < gain:
            swapped, worth = here[c].copy(), value[c]
            here[c], value[c] = here[c + 1], value[c + 1]
            here[c + 1], value[c + 1] = swapped, worth
        k = (2 * step - steps) * KEPT // steps
        if k >= 0:
            kept[k] = here[0]
    return kept


def _dense(way):
    """A way at 101 points that are evenly apart."""
    along = np.append(0, np.cumsum(np.hypot(*np.diff(way, axis=0).T)))
    even = np.linspace(0, along[-1], 101)
    return np.stack([np.interp(even, along, way[:, d]) for d in range(2)], axis=1)


def _inside(points, ellipses):
    """(P,) which points lie in one of some ellipses."""
    apart = (points[:, None] - ellipses[:, :2]) / ellipses[:, 2:]
    return np.any(np.sum(apart**2, axis=-1) < 1, axis=1)


def overlap(seed, subset, ways, truth, duration, steps):
    """A row of `overlaps`: what ways (N, 101, 2) of least cost tell of two ellipses."""
    costs = np.array([length(way) ** 2 / duration for way in ways])
    side = HALF * (2 * np.arange(_SIDE) + 1 - _SIDE) / _SIDE
    points = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    drawn = []
    for run in range(RUNS):
        rng = np.random.default_rng([seed, subset, run])
        drawn.append([_inside(points, each) for each in sample(rng, steps, ways, costs, duration)])
    area, expected = _named(np.concatenate(drawn))
    true, (one, other) = _inside(points, truth), (_named(np.array(draws))[0] for draws in drawn)
    return {
        "seed": seed,
        "subset": subset,
        "demonstrations": len(ways),
        "overlap": _shared(area, true),
        "expected": expected,
        "alike": _shared(one, other),
    }


def _shared(one, other):
    """Intersection over union of two areas."""
    return np.sum(one & other) / np.sum(one | other)


def _named(draws):
    """The area with the largest expected overlap, and that."""
    return best_area(draws, np.full(len(draws), 1 / len(draws)))


def _world(seed, steps):
    """The rows of one seed, of both tables."""
    settings = composed("experiment=areas", f"seed={seed}")
    truth = np.array([[*ball.center, *ball.radii] for ball in settings.truth.balls], dtype=float)
    with TemporaryDirectory() as folder:
        trials = demonstrations(settings, Store(Path(folder)))
    costs, ways = [], []
    duration = settings.horizon
    for number in trials.kept(settings.demonstrations.keep):
        each = trials.demonstration(number, duration, settings.demonstrations.dt)
        spent = np.sum(each.controls**2) * duration / len(each.controls)
        way = shortest(each.states[0], each.states[-1], truth, _FINE)
        least = length(way) ** 2 / duration
        costs.append({"seed": seed, "demonstration": number, "cost": spent, "least": least})
        ways.append(_dense(way))
    overlaps = []
    for subset in range(SUBSETS):
        order = np.random.default_rng([seed, subset]).permutation(len(ways))
        for size, count in STEPS.items():
            some = np.array([ways[j] for j in order[:size]])
            overlaps.append(overlap(seed, subset, some, truth, duration, steps or count))
    return costs, overlaps


def _summary(costs, overlaps):
    """Means over seeds by number of demonstrations; quantiles of the ratio have no interval."""
    rows = []
    for size, some in overlaps.groupby("demonstrations"):
        for measure in ("overlap", "expected", "alike"):
            of_seeds = some.groupby("seed")[measure].mean().to_numpy()
            rows.append({"measure": measure, "demonstrations": size, **interval(of_seeds)})
    ratio = costs["cost"] / costs["least"]
    for share in (0.1, 0.5, 0.9):
        rows.append({"measure": f"ratio_{share:g}", "mean": ratio.quantile(share)})
    return pd.DataFrame(rows).rename(columns={"lower": "low", "upper": "high"})


def main() -> None:
    """Write both tables, and print what they say."""
    parser = argparse.ArgumentParser(prog="shortest_ways", description=__doc__)
    parser.add_argument("--results", type=Path, default=timing.ROOT / "results", metavar="DIR")
    parser.add_argument("--steps", type=int, help="of each chain")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    given = parser.parse_args()
    if given.steps is not None and given.steps < 2 * KEPT:
        parser.error(f"a chain keeps {KEPT} of its last half: at least {2 * KEPT} steps")
    rows = Parallel(n_jobs=-1)(delayed(_world)(seed, given.steps) for seed in given.seeds)
    costs, overlaps = (pd.DataFrame([row for each in rows for row in each[i]]) for i in (0, 1))
    summary = _summary(costs, overlaps)
    print(summary.to_string(index=False))
    folder, written = given.results / "shortest_ways", {}
    for name, table in (("costs", costs), ("overlaps", overlaps), ("summary", summary)):
        content = csv_bytes(table.round(6))
        replace_file(folder / "tables" / f"{name}.csv", content)
        written[f"{name}.csv"] = digest(content)
    write_collated(folder, collated({}, written))


if __name__ == "__main__":
    main()
