"""The first cells of a tree: those of a grid, but each goal is in the middle of its cell.

A trajectory ends in a cell of its goal, and its last move is bent to the goal. Where the goal is
off the middle of its cell, what ends there is off by as much on average: an error of first order in
the cells' width, and the largest of all. A tree can be split round the goal.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mlci.cells.box_tree import LEAF, BoxTree
from mlci.grids import Grid
from mlci.spaces import Box, Floats, StateSpace

_NARROW = 0.25  # of a width: a goal so near to a border has a cell that begins there
_SLIVER = 0.3  # of a cell's width: borders of the grid nearer to a side than this are left out


def goal_tree(grid: Grid, goals: Sequence[Box], widths: Floats) -> BoxTree:
    """The cells of a grid, split round goals.

    A goal that is a point along a dimension gets a cell of a width, with the point in its middle as
    far as borders of the space and other goals leave room. One that has sides is cut out there.

    Args:
        grid: the cells elsewhere, without offset.
        goals: the goals.
        widths: (n,) of the cells of goals that are points.

    Raises:
        ValueError: a grid whose cells are shifted.
    """
    if any(grid.offset):
        raise ValueError("a tree begins at the bounds of the space: a grid without offset")
    cells = [cell for goal in goals if (cell := _cell_of(grid.space, goal, widths)) is not None]
    nodes = list(_nodes(grid, grid.space.bounds, cells))
    return BoxTree(grid.space, *(np.array(column) for column in zip(*nodes, strict=True)))


@dataclass(frozen=True, eq=False)
class _GoalCell:
    """What is to be cells of its own for a goal: one, round a point, or those of a region."""

    box: Box
    is_one: bool

    def within(self, box: Box) -> _GoalCell | None:
        """What of it is in a box; None for nothing."""
        lower = np.maximum(self.box.lower, box.lower)
        upper = np.minimum(self.box.upper, box.upper)
        return _GoalCell(Box(lower, upper), self.is_one) if np.all(lower < upper) else None


def _cell_of(space: StateSpace, goal: Box, widths: Floats) -> _GoalCell | None:
    """What of a goal is in the space; None for nothing."""
    bounds, point = space.bounds, goal.widths == 0
    at = space.wrap(np.where(point, goal.lower, bounds.lower))
    room, half = np.minimum(at - bounds.lower, bounds.upper - at), widths / 2
    half = np.where((half > room) & (room >= _NARROW * widths), room, half)
    lower, upper = np.where(point, at - half, goal.lower), np.where(point, at + half, goal.upper)
    if np.any((lower > bounds.upper) | (upper < bounds.lower)):
        return None
    return _GoalCell(Box(lower, upper), bool(np.all(point))).within(bounds)


def _nodes(grid: Grid, box: Box, goals: Sequence[_GoalCell]) -> Iterator[tuple[int, float]]:
    """The nodes (dimension, position) of a box in preorder, with some goals' cells in it."""
    split = _between_goals(box, goals)
    if split is None and not any(goal.is_one for goal in goals):
        split = _between_cells(grid, box)
    if split is None:
        yield LEAF, 0.0
        return
    yield split
    lower, upper = box.lower.copy(), box.upper.copy()
    lower[split[0]] = upper[split[0]] = split[1]
    for part in (Box(box.lower, upper), Box(lower, box.upper)):
        inside = [rest for goal in goals if (rest := goal.within(part)) is not None]
        yield from _nodes(grid, part, inside)


def _between_goals(box: Box, goals: Sequence[_GoalCell]) -> tuple[int, float] | None:
    """The side of a goal's cell that cuts through the fewest cells of others and parts most."""
    best: tuple[int, int] | None = None
    found = None
    lower = np.array([goal.box.lower for goal in goals])
    upper = np.array([goal.box.upper for goal in goals])
    for side in (*lower, *upper):
        for d, position in enumerate(side.tolist()):
            if not box.lower[d] < position < box.upper[d]:
                continue
            cut = int(np.sum((lower[:, d] < position) & (position < upper[:, d])))
            below, above = np.sum(upper[:, d] <= position), np.sum(lower[:, d] >= position)
            value = -cut, int(min(below, above))
            if best is None or value > best:
                best, found = value, (d, position)
    return found


def _between_cells(grid: Grid, box: Box) -> tuple[int, float] | None:
    """The border of the grid's cells that is nearest to the middle of a box."""
    lower, widths = grid.space.bounds.lower, grid.widths
    for d in np.argsort(-box.widths / widths, kind="stable").tolist():
        first = float((box.lower[d] - lower[d]) / widths[d])
        last = float((box.upper[d] - lower[d]) / widths[d])
        number = round((first + last) / 2 + 1e-9)
        if first + _SLIVER < number < last - _SLIVER:
            return d, float(lower[d] + number * widths[d])
    return None
