"""The recursions of several tasks at once, on copies of their model side by side.

On a small model, a step of one task is less work than the calls of numpy that it takes. So tasks
with one model and one number of steps become one task on a larger model, of which cell j S + s is
cell s of task j. Each sum has the terms that it has for the task alone, in the same order, so that
results are the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby, pairwise
from typing import Protocol, TypeVar

import numpy as np

from mlci.end_moves import EndMoves
from mlci.recursions import (
    add_moves,
    avoidance_backwards,
    avoidance_of_moves,
    reachable_cells,
    soft_bellman_backup,
)
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import TabularModel

ALPHA_BYTES = 1 << 29  # of probabilities held at once, else regions go block by block
_MOVES_AT_ONCE = 1 << 16  # merged moves of all copies; more do not stay in the cache


class Distribution(Protocol):
    """What is asked of a `mlci.maxent.TrajectoryDistribution`, with the names that it has there."""

    @property
    def model(self) -> TabularModel: ...
    @property
    def start(self) -> int: ...
    @property
    def goal(self) -> Ints: ...
    @property
    def steps(self) -> int: ...
    @property
    def ends(self) -> object: ...
    @property
    def log_z(self) -> Floats: ...
    @property
    def is_possible(self) -> bool: ...
    @property
    def start_moves(self) -> EndMoves: ...
    @property
    def goal_moves(self) -> EndMoves: ...
    @property
    def cells_between(self) -> list[Ints]: ...


_Each = TypeVar("_Each", bound=Distribution)


def batches(distributions: Iterable[_Each]) -> Iterator[list[_Each]]:
    """Neighbours with one model, number of steps and kind of ends, as many as a cache holds."""
    for _, alike in groupby(
        distributions, lambda each: (id(each.model), each.steps, each.ends is None)
    ):
        batch: list[_Each] = []
        for each in alike:
            batch.append(each)
            if len(batch) * len(each.model.merged.successor) >= _MOVES_AT_ONCE:
                yield batch
                batch = []
        if batch:
            yield batch


def log_z_of_tasks(batch: Sequence[Distribution]) -> Floats:
    """log Z to go (T+1, N, S) [nat] of the N tasks of a batch; each also keeps its own."""
    model, steps, count = batch[0].model, batch[0].steps, len(batch)
    merged = model.merged.copies(count)
    log_z = np.full((steps + 1, count, model.states), -np.inf)
    flat = log_z.reshape(steps + 1, -1)
    if batch[0].ends is None:
        starts = _side_by_side([[each.start] for each in batch], model.states)
        cells = reachable_cells(merged, starts, steps)
        goals = _side_by_side([each.goal for each in batch], model.states)
        flat[steps, np.intersect1d(cells[-1], goals)] = 0.0
        soft_bellman_backup(merged, flat, dict(enumerate(cells[:-1])))
    else:
        for j, each in enumerate(batch):
            log_z[steps, j, each.goal] = 0.0
            if steps > 1:
                add_moves(log_z[:, j], steps - 1, each.goal_moves)
        if steps > 1:
            between = zip(*(each.cells_between[:-1] for each in batch), strict=True)
            cells = [_side_by_side(parts, model.states) for parts in between]
            soft_bellman_backup(merged, flat, dict(enumerate(cells, start=1)))
        for j, each in enumerate(batch):
            add_moves(log_z[:, j], 0, each.start_moves)
    for j, each in enumerate(batch):
        vars(each)["log_z"] = log_z[:, j]
    return log_z


def are_possible(batch: Sequence[Distribution]) -> Bools:
    """Which tasks (N,) of a batch can be done."""
    log_z_of_tasks(batch)
    return np.array([each.is_possible for each in batch])


def avoidance_of_tasks(batch: Sequence[Distribution]) -> Floats:
    """alpha (N, C) of the N tasks of a batch, all of which are possible."""
    log_z = np.stack([each.log_z for each in batch], axis=1).reshape(batch[0].steps + 1, -1)
    regions = len(batch[0].model.regions)
    support = int(np.max(np.sum(log_z > -np.inf, axis=1)))
    blocks = min(regions, -(-regions * 2 * 8 * support // ALPHA_BYTES))
    edges = np.linspace(0, regions, max(1, blocks) + 1).astype(int)
    alpha = np.concatenate([_avoidance(batch, log_z, *block) for block in pairwise(edges)], axis=1)
    return np.minimum(alpha, 1.0)


def _avoidance(batch: Sequence[Distribution], log_z: Floats, first: int, last: int) -> Floats:
    """alpha (N, C') of the regions from `first` to before `last`."""
    steps, merged = batch[0].steps, batch[0].model.merged.copies(len(batch))
    at_goal = [np.ones((_support(each, steps), last - first)) for each in batch]
    if batch[0].ends is None:
        return avoidance_backwards(merged, log_z, np.concatenate(at_goal), steps, 0, first)
    after = at_goal
    if steps > 1:
        before_goal = [
            avoidance_of_moves(each.log_z, steps - 1, each.goal_moves, ones, first)
            for each, ones in zip(batch, at_goal, strict=True)
        ]
        alpha = avoidance_backwards(merged, log_z, np.concatenate(before_goal), steps - 1, 1, first)
        after = np.split(alpha, np.cumsum([_support(each, 1) for each in batch])[:-1])
    at_start = [
        avoidance_of_moves(each.log_z, 0, each.start_moves, alpha, first)
        for each, alpha in zip(batch, after, strict=True)
    ]
    return np.concatenate(at_start)


def _support(distribution: Distribution, t: int) -> int:
    """How many cells carry probability at step t."""
    return int(np.sum(distribution.log_z[t] > -np.inf))


def _side_by_side(cells: Sequence[Ints | list[int]], states: int) -> Ints:
    """Cells of each task as cells of the copies of its model."""
    return np.concatenate([np.asarray(part) + j * states for j, part in enumerate(cells)])
