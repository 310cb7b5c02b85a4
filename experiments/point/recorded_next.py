"""What to record next, beside recorded demonstrations: candidates, and the best of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.config.problems import ConfigError
from experiments.config.settings import RecordedSettings
from experiments.point.recorded import task_table
from experiments.progress import begin
from mlci.demonstrations import Demonstration, Task
from mlci.inference import Inference
from mlci.models import Model
from mlci.next_task import NextTask, next_tasks
from mlci.spaces import Box


def recorded_next_tasks(
    settings: RecordedSettings,
    model: Model,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
) -> list[NextTask]:
    """The tasks whose demonstrations are expected to teach most, each as long as the median.

    Raises:
        ConfigError: a table of candidates that cannot be used.
    """
    if not settings.next_tasks.count:
        return []
    begin("choosing what to record next")
    candidates = candidate_tasks(
        settings, float(np.median([each.task.horizon for each in demonstrations]))
    )
    return next_tasks(
        model,
        inference,
        list(candidates.values()),
        count=settings.next_tasks.count,
        names=list(candidates),
        round_horizon=True,
        exact_ends=settings.inference.exact_ends,
        progress=lambda done, of: begin(f"choosing what to record next: task {done} of {of}"),
    )


def candidate_tasks(settings: RecordedSettings, horizon: float) -> dict[str, Task]:
    """Tasks by their names: those of a table, or drawn from a box, the same each time.

    Args:
        settings: where they are from.
        horizon: duration of each [s].

    Raises:
        ConfigError: a table that cannot be used, or whose tasks lack an end.
    """
    chosen, space = settings.next_tasks, settings.model.space
    if chosen.file is None:
        box = space.bounds if chosen.box is None else chosen.box.start_box(space)
        offsets = None if chosen.box is None else chosen.box.goal_offsets
        reach = Box.point(np.zeros(space.dimension)) if offsets is None else offsets
        rng = np.random.default_rng(0)
        ends = rng.uniform(box.lower, box.upper, (chosen.candidates, 2, space.dimension))
        return {
            str(number): Task(start, Box(goal + reach.lower, goal + reach.upper), horizon)
            for number, (start, goal) in enumerate(ends)
        }
    table = task_table("next_tasks.file", chosen.file, space)
    tasks = {}
    for name, ends_of in table.items():
        if ends_of.start is None or ends_of.goal is None:
            raise ConfigError(
                f"next_tasks.file: {chosen.file}: a candidate needs a start and a goal; give "
                "columns of both, as of `tasks`"
            )
        tasks[name] = Task(ends_of.start, ends_of.goal, horizon)
        if not space.contains(ends_of.start):
            raise ConfigError(
                f"next_tasks.file: {chosen.file}: {name} starts at {ends_of.start.tolist()}, "
                "outside the state space"
            )
    return tasks
