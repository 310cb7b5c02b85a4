"""One task in six dimensions: python -m tests.benchmark.six_dimensions [KEY=VALUE ...]

The two-link arm of `subject/two_link_arm.yaml`: 3.84e9 moves, of which the merged ones are held.
Prints processor time and peak memory of each step. Values of the config can be changed, such as
grid.shape=[5,5,5,5,5,5] for a try.
"""

from __future__ import annotations

from tests.benchmark import timing  # before numpy, which is told to use one thread

# isort: split

import sys
import time
from pathlib import Path

import numpy as np
from tqdm import tqdm

from experiments.tracking.environment import peak_memory
from mlci.demonstrations import Task
from mlci.evidence import rank_constraints
from mlci.maxent import TrajectoryDistribution
from mlci.simulate import rollout, step_count
from mlci.spaces import Box
from mlci.tabular import discretize
from tests.benchmark.configs import composed

MOST_MEMORY = 16_000  # [MB]


def main(words: list[str]) -> int:
    """Discretise, infer and rank one task; 1 if it took too much memory."""
    folder = Path(__file__).parent
    settings = composed(f"hydra.searchpath=[file://{folder}]", "subject=two_link_arm", *words)
    grid, samples = settings.cells, settings.transition.samples
    print(", ".join(f"{key} {value}" for key, value in timing.machine().items()))
    with tqdm(total=grid.size, unit="cell", smoothing=0) as bar:
        model = discretize(
            settings.model,
            grid,
            settings.action_values,
            settings.dt,
            settings.candidates,
            samples,
            progress=lambda done, _: bar.update(done - bar.n),
        )
        merged = model.merged
    _report(f"{grid.size} cells of {model.moves} moves: {len(merged.successor)} merged moves")
    offsets = settings.tasks.goal_offsets
    assert offsets is not None
    start = np.array([0.1, 0.8, 0.8, 0.5, -0.1, -0.1])
    # To where it comes by itself.
    steps = step_count(settings.horizon, settings.dt)
    middle = rollout(model.system, start, np.zeros((steps, 2)), settings.dt)[-1]
    goal = Box(middle + offsets.lower, middle + offsets.upper)
    task = Task(start, goal, settings.horizon)
    distribution = TrajectoryDistribution.of_task(model, task, exact_ends=True)
    log_z = float(distribution.log_z[0, distribution.start])
    _report(f"log Z {log_z:.3f} nat over {distribution.steps} steps")
    phi = distribution.violation_probabilities()
    ranking = rank_constraints(phi[None], np.zeros((1, len(phi)), dtype=bool))
    _report(f"{len(phi)} hypotheses ranked, first {ranking.order[0]} with {np.max(phi):.3f}")
    return int(peak_memory() > MOST_MEMORY)


def _report(what: str) -> None:
    """Print what has been done, and what it has taken so far."""
    print(f"{time.process_time():8.0f} s  {peak_memory():6d} MB  {what}", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
