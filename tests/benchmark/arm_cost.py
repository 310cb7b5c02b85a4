"""What a sampled task costs from 2 to 12 dimensions: python -m tests.benchmark.arm_cost OUT.csv

Arms are the outer links of conf/system/arm6.yaml. A row has the CPU time of the search for modes,
and of drawing and weighing paths without refits, which is what grows with samples, steps and modes;
and beside it how many cells a grid with ten along each dimension would need.
"""

from __future__ import annotations

from tests.benchmark import timing  # noqa: F401  before numpy, which is told to use one thread

# isort: split

import sys
import time
from dataclasses import replace

import numpy as np
import pandas as pd

from mlci.demonstrations import Task
from mlci.mechanics.planar_chain import PlanarChain
from mlci.regions import Regions
from mlci.sampled.local_policies import riccati_policies
from mlci.sampled.model import SampledModel
from mlci.sampled.modes import find_modes
from mlci.sampled.proposals import Proposal, draw
from mlci.spaces import Box
from tests.benchmark.arm_worlds import Arm

SAMPLES, STEPS = 4000, 10
REPEATS = 3  # of which the quickest counts


def outer(system: PlanarChain, links: int) -> PlanarChain:
    """The arm of the outer links alone."""
    lists = {name: value for name, value in vars(system).items() if isinstance(value, tuple)}
    return replace(system, **{name: value[-links:] for name, value in lists.items() if value})


def cost(system: PlanarChain, samples: int, steps: int, copies: int) -> dict[str, float]:
    """CPU seconds of a task: searching for modes, drawing from so many copies of a policy."""
    links = system.links
    regions = Regions.from_grid(system.space, [10] + [None] * (2 * links - 1))
    model = SampledModel(system, regions, 1 / steps, samples=samples, substeps=1)
    start = np.append(np.full(links, -0.4), np.zeros(links))
    half = np.append(np.full(links, 0.15), np.full(links, np.inf))
    goal = np.append(np.full(links, 0.4), np.zeros(links))
    passage = model.passage(Task(start, Box(goal - half, goal + half), 1.0))
    times = {"search_s": np.inf, "draw_s": np.inf}
    for repeat in range(REPEATS):
        rng = np.random.default_rng(repeat)
        began = time.process_time()
        modes = find_modes(passage, model.restarts, rng)
        policies, _ = riccati_policies(passage, modes)
        times["search_s"] = min(times["search_s"], time.process_time() - began)
        first = joined = replace(policies, **{k: v[:1] for k, v in vars(policies).items()})
        for _ in range(copies - 1):
            joined = joined.joined(first)
        began = time.process_time()
        draw(passage, Proposal.of(joined, np.full(copies, 1 / copies), samples), rng)
        times["draw_s"] = min(times["draw_s"], time.process_time() - began)
    size = {"dimensions": 2 * links, "samples": samples, "steps": steps, "policies": copies}
    return {**size, **times, "grid_cells": 10.0 ** (2 * links)}


def main() -> None:
    """Change one size at a time."""
    arm = Arm("arm6", (5, 4), SAMPLES).system
    sizes = [(links, SAMPLES, STEPS, 1) for links in range(1, 7)]
    sizes += [(6, samples, STEPS, 1) for samples in (1000, 2000, 8000, 16000)]
    sizes += [(6, SAMPLES, steps, 1) for steps in (5, 20, 40)]
    sizes += [(6, SAMPLES, STEPS, copies) for copies in (2, 4, 8)]
    rows = []
    for links, *rest in sizes:
        rows.append(cost(outer(arm, links), *rest))
        print(", ".join(f"{key} {value:.3g}" for key, value in rows[-1].items()), flush=True)
    pd.DataFrame(rows).to_csv(sys.argv[1], index=False)


if __name__ == "__main__":
    main()
