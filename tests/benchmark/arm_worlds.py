"""Constraint inference for arms in seeded worlds: python -m tests.benchmark.arm_worlds --help

A world draws random tasks and lets a demonstrator do them optimally without a constraint. One
hypothesis that enough of the tasks cross, between ends outside of it, becomes the truth. The
demonstrator does some of those tasks anew with a `JointBarrier` that keeps out of it, and inference
by `SampledModel` ranks all hypotheses: cells over the angles of each two neighbouring joints, at
any speed, which do not nest.

A row a world goes to OUT.csv as soon as it is done; OUT_forecasts.csv has the forecasts of a task
that is not selected, with what the unconstrained demonstrator does.
"""

from __future__ import annotations

from tests.benchmark import timing  # noqa: F401  before numpy, which is told to use one thread

# isort: split

import argparse
import time
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from experiments.config.paths import CONF
from experiments.tracking.environment import peak_memory
from mlci.demonstrations import Demonstration
from mlci.demonstrator import Outcome, Trial, demonstrate, sample_trials
from mlci.mechanics.planar_chain import PlanarChain
from mlci.preparation import infer, prepare
from mlci.rank_errors import rank_errors
from mlci.regions import Regions
from mlci.safety.joint_barrier import JointBarrier
from mlci.sampled.model import SampledModel
from mlci.simulate import RK4
from mlci.spaces import Bools, Box

BRAKING = 8.0  # [rad/s^2] that the demonstrator trusts each joint to
MARGIN = 0.02  # [rad] that it stays away from the truth
HORIZON = 1.0  # [s]
DT = 0.025  # [s] of the demonstrator
WEIGHT = 300.0  # price of the squared distance from the goal, as in conf/config.yaml


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm of conf/system, its tasks and hypotheses.

    Attributes:
        name: of the file.
        cells: hypotheses along the first and the second joint of each pair.
        samples: of a task.
    """

    name: str
    cells: tuple[int, int]
    samples: int

    @cached_property
    def config(self) -> Any:
        """The file's tree."""
        return yaml.safe_load((CONF / "system" / f"{self.name}.yaml").read_text())

    @cached_property
    def system(self) -> PlanarChain:
        """The arm."""
        given = {key: value for key, value in self.config["system"].items() if key[0] != "_"}
        lists = {key: tuple(value) for key, value in given.items() if isinstance(value, list)}
        return PlanarChain(**(given | lists))

    @cached_property
    def hypotheses(self) -> Regions:
        """Cells over each pair of neighbouring joints."""
        links, space = self.system.links, self.system.space
        parts = []
        for joint in range(links - 1):
            shape: list[int | None] = [None] * (2 * links)
            shape[joint : joint + 2] = self.cells
            parts.append(Regions.from_grid(space, shape))
        found = parts[0]
        for part in parts[1:]:
            found = found.joined(part)
        return found

    @cached_property
    def model(self) -> SampledModel:
        """What infers: one Runge-Kutta step a hold, off by about 0.01 rad in a second of noise."""
        dt = self.config["dt"]
        return SampledModel(self.system, self.hypotheses, dt, samples=self.samples, substeps=1)

    def trials(self, seed: int, count: int, dt: float) -> list[Trial]:
        """Tasks of a world."""
        tasks = self.config["tasks"]
        half = np.array([np.inf if side is None else side for side in tasks["goal"]])
        return sample_trials(
            self.system,
            None,
            Box(tasks["lower"], tasks["upper"]),
            trials=count,
            seed=seed,
            horizon=HORIZON,
            dt=dt,
            goal_offsets=Box(-half, half),
            restarts=1,
        )


def crossed(arm: Arm, demonstrations: list[Demonstration]) -> Bools:
    """Which hypotheses (N, C) paths enter."""
    paths = np.array([demonstration.states for demonstration in demonstrations])
    return np.asarray(arm.hypotheses.violated_by(paths))


def unconstrained(arm: Arm, seed: int, count: int) -> tuple[list[int], list[Demonstration]]:
    """Numbers and paths of a world's tasks that the demonstrator does without a constraint."""
    trials = arm.trials(seed, count, arm.config["dt"])
    attempts = demonstrate(
        arm.system, trials, None, None, dt=arm.config["dt"], goal_weight=WEIGHT, integrator=RK4
    )
    kept = [i for i, each in enumerate(attempts) if each.outcome is Outcome.KEPT]
    return kept, [attempts[i].demonstration for i in kept]


def world(
    arm: Arm, seed: int, count: int, wanted: int
) -> tuple[dict[str, Any], pd.DataFrame | None]:
    """A row of results, and forecasts of a task that is not selected."""
    began = time.process_time()
    numbers, plain = unconstrained(arm, seed, count)
    ends = np.array([[each.task.start, _middle(each.task.goal)] for each in plain])
    enters = crossed(arm, plain) & ~arm.hypotheses.violated_by(ends[:, :, None]).any(axis=1)
    often = np.flatnonzero(np.sum(enters, axis=0) >= 2 * wanted)
    if not len(often):
        return {"seed": seed, "crossing": int(np.max(np.sum(enters, axis=0)))}, None
    truth = int(np.random.default_rng([seed, 1]).choice(often))
    regions = arm.hypotheses.select(np.arange(len(arm.hypotheses)) == truth)
    barrier = JointBarrier(arm.system, regions, DT, (BRAKING,) * arm.system.links, MARGIN)
    trials = arm.trials(seed, count, DT)
    tried = [trials[numbers[i]] for i in np.flatnonzero(enters[:, truth])][: 3 * wanted]
    attempts = demonstrate(
        arm.system, tried, regions, barrier, dt=DT, goal_weight=WEIGHT, iterations=20
    )
    kept = [each.demonstration for each in attempts if each.outcome is Outcome.KEPT][:wanted]
    outcomes = Counter(str(each.outcome) for each in attempts)
    row: dict[str, Any] = {
        "seed": seed, "truth": truth, "crossing": int(np.sum(enters[:, truth])),
        "tried": len(tried), **{f"outcome_{each}": outcomes[each] for each in Outcome},
        "demonstrations": len(kept), "setup_s": time.process_time() - began,
    }  # fmt: skip
    if len(kept) < wanted:
        return row, None
    began = time.process_time()
    inference = infer(arm.model, kept)
    row["infer_s"] = time.process_time() - began
    errors, order = rank_errors(inference), inference.order
    assert inference.sampling is not None
    row |= {
        "rank": inference.ranking.rank[truth],
        "rank_lowest": errors.lowest[truth],
        "rank_highest": errors.highest[truth],
        "posterior": inference.posterior[truth],
        "posterior_none": inference.posterior_none,
        "first": int(order[0]),
        "posterior_first": inference.posterior[order[0]],
        "in_credible_set": truth in inference.credible.regions.tolist(),
        "phi_truth": float(np.mean(inference.phi[:, truth])),
        "untrusted": sum(map(bool, inference.sampling.complaints)),
        "memory_mb": peak_memory(),
    }
    others = [demonstration.task for demonstration in plain[:1]]
    prepared = prepare(arm.model, others)
    hits = crossed(arm, plain[:1])
    columns = {"phi": (1 - prepared.avoidance).ravel(), "crossed": hits.ravel()}
    forecasts = pd.DataFrame({"seed": seed, **columns})
    return row, forecasts


def _middle(goal: Box) -> np.ndarray:
    """A goal's middle (n,); at rest where it is free."""
    free = ~np.isfinite(goal.widths)
    lower, upper = (np.where(free, 0.0, side) for side in (goal.lower, goal.upper))
    return np.asarray((lower + upper) / 2)


def main() -> None:
    """Run worlds and write their rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="path of the results without .csv")
    parser.add_argument("--arm", default="arm6", help="a file of conf/system")
    parser.add_argument("--cells", type=int, nargs=2, default=(5, 4))
    parser.add_argument("--seeds", type=int, nargs="+", default=range(10))
    parser.add_argument("--samples", type=int, default=4000)
    parser.add_argument("--tasks", type=int, default=60, help="drawn in a world")
    parser.add_argument("--demonstrations", type=int, default=5)
    given = parser.parse_args()
    arm = Arm(given.arm, tuple(given.cells), given.samples)
    rows, forecasts = [], []
    for seed in given.seeds:
        row, forecast = world(arm, seed, given.tasks, given.demonstrations)
        rows.append(row)
        forecasts += [] if forecast is None else [forecast]
        pd.DataFrame(rows).to_csv(f"{given.out}.csv", index=False)
        if forecasts:
            pd.concat(forecasts).to_csv(f"{given.out}_forecasts.csv", index=False)
        print(", ".join(f"{key} {value:.3g}" for key, value in row.items() if value), flush=True)


if __name__ == "__main__":
    main()
