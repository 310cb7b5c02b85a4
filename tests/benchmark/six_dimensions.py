"""One task in six dimensions: python -m tests.benchmark.six_dimensions [KEY=VALUE ...]

The two-link arm of `subject/two_link_arm.yaml`: 1e6 cells of 3840 moves, of which those are
followed that the task can come by. Prints time and peak memory of each step. Values of the config
can be changed, such as grid.shape=[5,5,5,5,5,5] for a try.
"""

from __future__ import annotations

from tests.benchmark import timing  # before numpy, which is told to use one thread

# isort: split

import os
import resource
import sys
import time
from pathlib import Path

import numpy as np
from tqdm import tqdm

from experiments.tracking.environment import peak_memory
from mlci.demonstrations import Task
from mlci.evidence import rank_constraints
from mlci.exploration import explore
from mlci.maxent import TrajectoryDistribution
from mlci.simulate import rollout, step_count
from mlci.spaces import Box
from mlci.tabular import TabularModel
from tests.benchmark.configs import composed

MOST_MEMORY = 16_000  # [MB]


def main(words: list[str]) -> int:
    """Discretise, infer and rank one task; 1 if it took too much memory."""
    folder = Path(__file__).parent
    settings = composed(f"hydra.searchpath=[file://{folder}]", "subject=two_link_arm", *words)
    samples, processes = settings.transition.samples, os.cpu_count() or 1
    print(", ".join(f"{key} {value}" for key, value in timing.machine().items()))
    model = TabularModel(
        settings.model,
        settings.cells,
        settings.action_values,
        settings.dt,
        settings.candidates,
        samples,
    )
    offsets = settings.tasks.goal_offsets
    assert offsets is not None
    start = np.array([0.1, 0.8, 0.8, 0.5, -0.1, -0.1])
    # To where it comes by itself.
    steps = step_count(settings.horizon, settings.dt)
    middle = rollout(model.system, start, np.zeros((steps, 2)), settings.dt)[-1]
    goal = Box(middle + offsets.lower, middle + offsets.upper)
    task = Task(start, goal, settings.horizon)
    with tqdm(unit="cell", smoothing=0) as bar:
        model = explore(
            model, [task], n_jobs=processes, progress=lambda done: bar.update(done - bar.n)
        )
    assert model.explored is not None
    _report(
        f"{np.sum(model.explored.cells)} of {model.states} cells followed, of {model.moves} moves: "
        f"{len(model.merged.successor)} merged moves",
        processes,
    )
    distribution = TrajectoryDistribution.of_task(model, task, exact_ends=True)
    avoidance = distribution.avoidance_probabilities()
    log_z = float(distribution.log_z[0, distribution.start])
    active = np.any(distribution.log_z > -np.inf, axis=0).sum()
    _report(
        f"log Z {log_z:.3f} nat over {distribution.steps} steps, {active} active cells", processes
    )
    ranking = rank_constraints(avoidance[None], np.zeros((1, len(avoidance)), dtype=bool))
    first = ranking.order[0]
    _report(
        f"{len(avoidance)} hypotheses ranked, first {first} with Phi {1 - avoidance[first]:.3f}",
        processes,
    )
    return int(_memory(processes) > MOST_MEMORY)


def _memory(processes: int) -> int:
    """Peak of this process and of those that it started, all taken as large as the largest [MB]."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024
    return peak_memory() + processes * children


def _report(what: str, processes: int) -> None:
    """Print what has been done, and what it has taken so far."""
    seconds = time.perf_counter() - _BEGIN
    print(f"{seconds:8.0f} s  {_memory(processes):6d} MB  {what}", flush=True)


_BEGIN = time.perf_counter()

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
