"""How the error of Phi falls with the number of cells, for kinds of cells and of moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from experiments.config.memory import RESOLUTION_SAMPLES
from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.progress import begin
from mlci.cells.goal_cells import goal_tree
from mlci.cells.multilinear import MultilinearModel
from mlci.cells.refined_model import RefinedModel
from mlci.cells.refinement import refine
from mlci.demonstrations import Task
from mlci.exploration import explore
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.sampled.model import SampledModel
from mlci.spaces import Floats
from mlci.tabular import TabularModel

COLUMNS = ["kind", "count", "task", "possible", "error", "noise", "trusted", "error_of_cells"]
CENTRE, AVERAGED, MULTILINEAR = "centre", "averaged", "multilinear"
ROUND_GOALS, VARYING, OF_TASK = "round goals", "varying", "of each task"
Cells = TabularModel | RefinedModel

_TOLERANCE = 0.02  # of the goal, where paths are sampled: a fifth of a cell, to be near a point
_FEW_CELLS = 2000  # not worth exploring, and often too coarse for it


def resolution_table(settings: Settings, point: PointInference) -> pd.DataFrame:
    """A row a kind of cells, number of them and task.

    Returns:
        `kind`: `centre`, `averaged` and `multilinear` moves of equal cells; `round goals`, averaged
        moves of cells that are equal but for those of the goals; `varying`, averaged moves of cells
        that are refined for all the tasks; `of each task`, likewise, but for each task
        alone; `count` of cells; `task`; whether it is `possible`; over
        the hypotheses the root mean square `error` of Phi against paths sampled without cells,
        whose own standard error is the `noise`, and whether they can be `trusted`; and likewise
        `error_of_cells`, against very many equal cells with the same actions, NaN without them.
        Where a task is not possible, Phi is taken to be 0.
    """
    asked, regions = settings.resolution, settings.candidates
    tasks = [each.task for each in point.demonstrations[: asked.tasks]]
    sampled = SampledModel(
        settings.model,
        regions,
        settings.dt,
        temperature=settings.temperature,
        samples=asked.paths,
        seed=settings.seed,
        tolerance=_TOLERANCE,
        limit=settings.model.control_box,
    )
    distributions = [sampled.distribution(task) for task in tasks]
    reference = np.array(
        [
            each.violation_probabilities() if each.is_possible else np.zeros(len(regions))
            for each in distributions
        ]
    )
    noise = [
        _root_mean_square(each.avoidance_errors()) if each.is_possible else np.nan
        for each in distributions
    ]
    base = TabularModel(
        settings.model,
        settings.cells,
        settings.action_values,
        settings.dt,
        regions,
        temperature=settings.temperature,
    )
    limit = np.full_like(reference, np.nan)
    if asked.finest:
        finest = replace(base, grid=_scaled(settings.cells, asked.finest))
        limit = np.array([_phi(way) for way in _ways(finest, tasks)])
    rows = []
    for kind in asked.kinds:
        for count in asked.counts_of(kind):
            model = _KINDS[kind](base, tasks, count)
            if model is None:
                continue
            begin(f"{count} cells, {kind}")
            for number, way in enumerate(_ways(model, tasks)):
                phi = _phi(way)
                rows.append(
                    {
                        "kind": kind,
                        "count": way.model.states,
                        "task": number,
                        "possible": way.is_possible,
                        "error": _root_mean_square(phi - reference[number]),
                        "noise": noise[number],
                        "trusted": distributions[number].diagnosis.trusted,
                        "error_of_cells": _root_mean_square(phi - limit[number]),
                    }
                )
    return pd.DataFrame(rows, columns=COLUMNS)


def _scaled(grid: Grid, count: int) -> Grid:
    """A grid of about so many cells, in the same proportions."""
    factor = (count / grid.size) ** (1 / len(grid.shape))
    return Grid(grid.space, tuple(max(1, round(factor * each)) for each in grid.shape))


def _ways(model: Cells, tasks: Sequence[Task]) -> Iterator[TrajectoryDistribution]:
    """The distributions of tasks, one after the other; of many equal cells, only those are followed
    that the tasks come by."""
    if isinstance(model, RefinedModel):
        yield from map(model.distribution, tasks)
        return
    equal = type(model) is TabularModel and isinstance(model.grid, Grid)
    if equal and model.grid.size > _FEW_CELLS:
        model = explore(model, tasks)
    for task in tasks:
        yield TrajectoryDistribution.of_task(model, task, exact_ends=True)


def _phi(way: TrajectoryDistribution) -> Floats:
    """Phi (C,), 0 where the task is not possible."""
    if not way.is_possible:
        return np.zeros(len(way.model.regions))
    return way.violation_probabilities()


def _root_mean_square(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


Make = Callable[[TabularModel, Sequence[Task], int], Cells | None]


def _centre(base: TabularModel, _tasks: Sequence[Task], count: int) -> TabularModel:
    return replace(base, grid=_scaled(base.equal_cells, count))


def _averaged(base: TabularModel, tasks: Sequence[Task], count: int) -> TabularModel:
    return replace(_centre(base, tasks, count), samples=RESOLUTION_SAMPLES)


def _multilinear(base: TabularModel, _tasks: Sequence[Task], count: int) -> TabularModel:
    return MultilinearModel(
        base.system,
        _scaled(base.equal_cells, count),
        base.actions,
        base.dt,
        base.regions,
        temperature=base.temperature,
    )


def _round_goals(base: TabularModel, tasks: Sequence[Task], count: int) -> TabularModel:
    grid = _scaled(base.equal_cells, count)
    tree = goal_tree(grid, [task.goal for task in tasks], grid.widths)
    return replace(base, grid=tree, samples=RESOLUTION_SAMPLES)


def _varying(base: TabularModel, tasks: Sequence[Task], count: int) -> TabularModel | None:
    """None where the first cells are more than these already."""
    return (
        refine(replace(base, samples=RESOLUTION_SAMPLES), tasks, count)
        if count >= base.states
        else None
    )


def _of_task(base: TabularModel, _tasks: Sequence[Task], count: int) -> RefinedModel | None:
    """None likewise."""
    averaged = replace(base, samples=RESOLUTION_SAMPLES)
    return RefinedModel(averaged, count) if count >= base.states else None


_KINDS: dict[str, Make] = {
    CENTRE: _centre,
    AVERAGED: _averaged,
    MULTILINEAR: _multilinear,
    ROUND_GOALS: _round_goals,
    VARYING: _varying,
    OF_TASK: _of_task,
}
