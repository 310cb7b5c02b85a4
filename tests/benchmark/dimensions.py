"""What a task costs without a grid, from 2 to 12 dimensions: python -m tests.benchmark.dimensions

Arms are the outer links of conf/system/arm6.yaml, from one to six. A row has processor time of one
thread: of the search for modes; of drawing and weighing paths without refits, which is what grows
with samples, steps and modes; and of the whole task with Phi of ten hypotheses. Each row is
measured in a process of its own, whose peak memory is therefore its own. The table goes to
results/dimensions/tables/dimensions.csv; `--results DIR` names another folder of results.
"""

from __future__ import annotations

from tests.benchmark import timing  # before numpy, which is told to use one thread

# isort: split

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from experiments.config.paths import CONF
from experiments.tracking.environment import peak_memory
from experiments.tracking.files import csv_bytes, digest, replace_file
from experiments.tracking.study import collated, write_collated
from mlci.demonstrations import Task
from mlci.mechanics.planar_chain import PlanarChain
from mlci.regions import Regions
from mlci.sampled.local_policies import riccati_policies
from mlci.sampled.model import SampledModel
from mlci.sampled.modes import find_modes
from mlci.sampled.proposals import Proposal, draw
from mlci.spaces import Box

LINKS, SAMPLES, STEPS, MODES = 6, 4000, 10, 1  # where they are not what grows
REPEATS = 3  # of which the quickest counts

# What grows, and the sizes at which it is measured.
FACTORS = {
    "dimensions": (2, 4, 6, 8, 10, 12),
    "samples": (1000, 2000, 4000, 8000, 16000),
    "steps": (5, 10, 20, 40),
    "modes": (1, 2, 4, 8),
}


def outer_links(count: int) -> PlanarChain:
    """The outer links of the arm of conf/system/arm6.yaml."""
    given = yaml.safe_load((CONF / "system" / "arm6.yaml").read_text())["system"]
    given.pop("_target_")
    lists = {
        name: tuple(value[-count:]) for name, value in given.items() if isinstance(value, list)
    }
    return PlanarChain(**(given | lists))


def measure(factor: str, value: int) -> dict[str, Any]:
    """A row: what one task costs at one size."""
    sizes = {"dimensions": 2 * LINKS, "samples": SAMPLES, "steps": STEPS, "modes": MODES}
    sizes[factor] = value
    links = sizes["dimensions"] // 2
    system = outer_links(links)
    regions = Regions.from_grid(system.space, [10] + [None] * (2 * links - 1))
    model = SampledModel(system, regions, 1 / sizes["steps"], samples=sizes["samples"], substeps=1)
    half = np.append(np.full(links, 0.15), np.full(links, np.inf))
    start, goal = (np.append(np.full(links, end), np.zeros(links)) for end in (-0.4, 0.4))
    task = Task(start, Box(goal - half, goal + half), 1.0)
    seconds = [_parts(model, task, sizes["modes"], repeat) for repeat in range(REPEATS)]
    search, drawing, whole = np.min(seconds, axis=0)
    return {
        "factor": factor,
        "value": value,
        **sizes,
        "search_s": search,
        "draw_s": drawing,
        "task_s": whole,
        "peak_mb": peak_memory(),
    }


def _parts(model: SampledModel, task: Task, modes: int, seed: int) -> tuple[float, float, float]:
    """Seconds of the search for modes, of drawing from so many copies of the first, and of all."""
    passage, rng = model.passage(task), np.random.default_rng(seed)
    began = time.process_time()
    policies, _ = riccati_policies(passage, find_modes(passage, model.restarts, rng))
    searched = time.process_time()
    first = joined = replace(policies, **{k: v[:1] for k, v in vars(policies).items()})
    for _ in range(modes - 1):
        joined = joined.joined(first)
    began_to_draw = time.process_time()
    draw(passage, Proposal.of(joined, np.full(modes, 1 / modes), model.samples), rng)
    drawn = time.process_time()
    model.distribution(task).violation_probabilities()
    return searched - began, drawn - began_to_draw, time.process_time() - drawn


def _apart(factor: str, value: int) -> dict[str, Any]:
    """The same in a process whose memory is its own."""
    command = [sys.executable, "-m", "tests.benchmark.dimensions", "--size", factor, str(value)]
    done = subprocess.run(command, cwd=timing.ROOT, stdout=subprocess.PIPE, text=True, check=True)
    row: dict[str, Any] = json.loads(done.stdout)
    return row


def main() -> None:
    """Measure every size and write the table, or print one row."""
    parser = argparse.ArgumentParser(prog="dimensions", description=__doc__)
    parser.add_argument("--results", type=Path, default=timing.ROOT / "results", metavar="DIR")
    parser.add_argument("--size", nargs=2, metavar=("FACTOR", "VALUE"))
    given = parser.parse_args()
    if given.size:
        print(json.dumps(measure(given.size[0], int(given.size[1]))))
        return
    rows = []
    for factor, values in FACTORS.items():
        for value in values:
            rows.append(_apart(factor, value) | timing.machine())
            print({key: rows[-1][key] for key in list(rows[-1])[:10]}, flush=True)
    table, folder = pd.DataFrame(rows), given.results / "dimensions"
    floats = table.select_dtypes("float").columns
    content = csv_bytes(table.assign(**{each: table[each].round(4) for each in floats}))
    replace_file(folder / "tables" / "dimensions.csv", content)
    write_collated(folder, collated({}, {"dimensions.csv": digest(content)}))


if __name__ == "__main__":
    main()
