"""Moves of the cells that some tasks can come by, where those of all cells would take too long.

A task occupies few cells. Those that can be occupied from its start are found by following the
moves themselves, and those that lie too far from its goal for the moves that are left are passed
over (`mlci.displacements`). So log Z of the task and its probabilities are those of the whole
model. Of the other cells nothing is known, and other tasks are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from mlci.demonstrations import Task
from mlci.displacements import Displacements
from mlci.explored import Explored
from mlci.maxent import TrajectoryDistribution
from mlci.merged_moves import MergedMoves, joined, merge_moves
from mlci.spaces import Ints
from mlci.tabular import TabularModel


def explore(
    model: TabularModel,
    tasks: Sequence[Task],
    *,
    round_horizon: bool = False,
    exact_ends: bool = True,
    bounded: bool = True,
    n_jobs: int = 1,
    progress: Callable[[int], None] | None = None,
) -> TabularModel:
    """The model with the moves of those cells that the tasks can occupy.

    Args:
        model: a model that keeps no moves: `TabularModel(system, grid, ...)`.
        tasks: what the model is for, as of `infer`.
        round_horizon, exact_ends: as of `infer`.
        bounded: pass over cells that are too far from the goal.
        n_jobs: processes.
        progress: called with how many cells are done.

    Raises:
        ValueError: moves go further than `mlci.displacements` tells; a start outside the state
            space; a horizon that dt does not divide.
    """
    ways = [
        TrajectoryDistribution.of_task(
            model, task, round_horizon=round_horizon, exact_ends=exact_ends
        )
        for task in tasks
    ]
    if exact_ends:  # it is seen on cells what these decide
        ways += [replace(way, ends=None) for way in ways]
    _ = model.substeps  # counted once
    reach = Displacements.of(model, n_jobs) if bounded else None
    row = np.full(model.states, -1)  # of a cell among those whose moves are known
    leads: list[Ints] = []  # cells that moves of each lead to, some more than once
    cells: list[Ints] = []
    parts: list[MergedMoves] = []
    for way in ways:
        now, steps = way.first_cells
        towards = None if reach is None else reach.towards(way.goal, steps)
        for left in range(steps, 0, -1):
            now = now if towards is None else now[towards[left, now]]
            new = now[row[now] < 0]
            blocks = list(model.blocks(new)) if len(new) else []
            for block, merged in zip(blocks, _formed(model, blocks, n_jobs), strict=True):
                if reach is not None:
                    reach.check(np.repeat(block, np.diff(merged.begins)), merged.successor)
                cells.append(block)
                parts.append(merged)
                row[block] = len(leads) + np.arange(len(block))
                leads += np.split(merged.successor, merged.begins[1:-1])
                if progress is not None:
                    progress(len(leads))
            reached = np.zeros(model.states, dtype=bool)
            for i in row[now].tolist():
                reached[leads[i]] = True
            now = np.flatnonzero(reached)
    explored = Explored(row >= 0, tuple((*way.first_cells, way.goal) for way in ways))
    result = replace(model, explored=explored)
    if parts:
        merged = joined(parts).placed(np.concatenate(cells), model.states)
        vars(result)["merged"] = merged.under(model.truth)
    vars(result)["substeps"] = model.substeps  # counted once
    return result


def _formed(model: TabularModel, blocks: Sequence[Ints], n_jobs: int) -> Iterable[MergedMoves]:
    """The merged moves of blocks of cells, in order."""
    from joblib import Parallel, delayed

    # Processes, as the user's dynamics are Python.
    work = Parallel(n_jobs=n_jobs, return_as="generator", max_nbytes=None)
    return work(delayed(_merged)(model, block) for block in blocks)


def _merged(model: TabularModel, cells: Ints) -> MergedMoves:
    """The merged moves of some cells."""
    return merge_moves([model.moves_of(cells)])
