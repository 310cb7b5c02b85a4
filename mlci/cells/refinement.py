"""Cells of varying size for some tasks: small where they matter, see `mlci.cells.importance`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mlci.cells.box_tree import LEAF, BoxTree
from mlci.cells.goal_cells import goal_tree
from mlci.cells.importance import importance
from mlci.demonstrations import Task
from mlci.maxent import TrajectoryDistribution
from mlci.tabular import Progress, TabularModel

MOST_MOVES = 1 << 28  # of all cells: some ten gigabytes, and hours


def refine(
    model: TabularModel,
    tasks: Sequence[Task],
    cells: int,
    *,
    growth: float = 0.3,
    round_horizon: bool = False,
    exact_ends: bool = True,
    progress: Progress | None = None,
) -> TabularModel:
    """The model with cells that are halved, round by round, where they matter most for some tasks.

    It serves all tasks, and these best. The same arguments give the same cells; the tree that is
    the result's `grid` says all of them by two arrays.

    Args:
        model: its cells are the first ones; its moves are not needed.
        tasks: what the cells are for.
        cells: how many there shall be.
        growth: share of the cells that are halved in a round.
        round_horizon, exact_ends: as of `infer`.
        progress: called with how many cells there are, and how many there shall be.

    Raises:
        ValueError: no task, a number of cells that is not whole, less than there are or too large,
            a growth outside (0, 1], or a task that the model cannot describe.
        TypeError: a model that has more than cells and start points, such as a multilinear one.
    """
    check_cells(model, cells)
    if not tasks:
        raise ValueError("cells are refined for tasks: there is none")
    if not 0 < growth <= 1:
        raise ValueError(f"the share of cells that are halved lies in (0, 1], not {growth}")
    tree = _first_tree(model, tasks, cells)
    points = [task.goal.lower for task in tasks if np.all(task.goal.widths == 0)]
    while True:
        refined = replace(model, grid=tree, kept=None, explored=None)
        if progress is not None:
            progress(tree.size, cells)
        if tree.size >= cells:
            return refined
        matters = np.zeros((tree.size, tree.space.dimension))
        for task in tasks:
            distribution = TrajectoryDistribution.of_task(
                refined, task, round_horizon=round_horizon, exact_ends=exact_ends
            )
            matters += importance(distribution, tree)
        if points:  # each stays in the middle of its cell
            matters[tree.index(points)] = 0.0
        more = min(cells - tree.size, max(1, int(growth * tree.size)))
        largest = np.max(matters, axis=1)
        halved = np.argsort(-largest, kind="stable")[:more]
        halved = halved[largest[halved] > 0]
        if not len(halved):
            return refined  # no task leaves its first cell
        along = np.full(tree.size, LEAF)
        along[halved] = np.argmax(matters[halved], axis=1)
        tree = tree.halved(along)


def check_cells(model: TabularModel, cells: int) -> None:
    """Whether a model can be refined to so many cells.

    Raises:
        ValueError: a number that is not whole, less than there are, or too large.
        TypeError: another model than a `TabularModel`.
    """
    if type(model) is not TabularModel:
        raise TypeError(f"cells of a TabularModel are refined, not of a {type(model).__name__}")
    if not isinstance(cells, int | np.integer):
        raise ValueError(f"a number of cells is whole, not {cells!r}")
    if cells < model.states:
        raise ValueError(f"there are {model.states} cells already: ask for more than {cells}")
    if cells * model.moves > MOST_MOVES:
        raise ValueError(
            f"{cells} cells of {model.moves} moves have more than the {MOST_MOVES} moves that can "
            f"be followed: ask for at most {MOST_MOVES // model.moves} cells, or take fewer "
            "actions or start points"
        )


def _first_tree(model: TabularModel, tasks: Sequence[Task], cells: int) -> BoxTree:
    """The cells of the model as a tree; those of a grid are split round the goals first.

    The cells of the goals are as wide as so many equal cells are.
    """
    grid = model.grid
    if isinstance(grid, BoxTree):
        return grid
    finer = (grid.size / cells) ** (1 / grid.space.dimension)
    return goal_tree(model.equal_cells, [task.goal for task in tasks], grid.widths * finer)
