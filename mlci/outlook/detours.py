"""Ways round a region that is forbidden, by the tabular model."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mlci.demonstrations import Task
from mlci.maxent import TrajectoryDistribution
from mlci.spaces import Bools, Ints
from mlci.tabular import TabularModel

# By region and tasks (B,), numbers both: which regions (B, C) the ways round it cross.
Detours = Callable[[int, Ints], Bools]

_COLD = 0.02  # of the model's temperature, at which hardly any way but the best is taken


def tabular_detours(model: TabularModel, tasks: Sequence[Task], hypotheses: Bools) -> Detours:
    """The best tabular way of each task that does not cross a region.

    It crosses nothing where there is none.

    Args:
        model: the tabular model.
        tasks: P tasks.
        hypotheses: (C',) mask over its regions; C of them count, and are numbered.
    """
    cold, numbers = model.with_temperature(_COLD * model.temperature), np.flatnonzero(hypotheses)

    def detours(region: int, which: Ints) -> Bools:
        allowed = cold.under(np.arange(len(hypotheses)) == numbers[region])
        crossed = np.zeros((len(which), len(numbers)), dtype=bool)
        for row, task in enumerate(which.tolist()):
            distribution = TrajectoryDistribution.of_task(allowed, tasks[task])
            if distribution.is_possible:
                cells, moves = distribution.sample(1, np.random.default_rng(0))
                crossed[row] = model.crossed(cells[:, :-1], moves)[0][numbers]
        return crossed

    return detours
