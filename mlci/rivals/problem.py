"""What every method is given: tasks in a finite table, what was done in them, and hypotheses.

Continuous systems come as their tabular models, so that all methods see one and the same world.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.rivals.agent import Agent
from mlci.spaces import Bools, Floats, Ints

# From a mask (C,) of regions, log alpha (C,) of avoiding all of them and each.
Beside = Callable[[Bools], Floats]


@dataclass(frozen=True, eq=False)
class Shown:
    """One demonstration and its task.

    Attributes:
        agent: the unconstrained agent of the task.
        states: (K+1,) where the demonstrator was, step by step.
        actions: (K,) what was done there; None where the path follows no moves of the table, as
            that of a continuous system.
        violated: (C,) the hypotheses that the path violates.
        avoidance: log alpha of sets; None where chance decides, so that what a path says depends
            on all of it.
        between_cells: the same, from cell to cell, where `avoidance` begins and ends at states.
    """

    agent: Agent
    states: Ints
    actions: Ints | None
    violated: Bools
    avoidance: Beside | None
    between_cells: Beside | None = None


@dataclass(frozen=True, eq=False)
class Problem:
    """N demonstrations in one table, and C hypotheses, of which the first tile a grid.

    Attributes:
        shown: the N demonstrations; their tables differ in start and goal alone.
        shape: numbers of hypotheses along each axis of their grid, in row-major order. Those that
            come after it, such as actions, are nobody's neighbours.
        inside: (S, C) boolean: which states belong to which hypothesis.
        positions: (S, d) where states lie, for distances, in units of a hypothesis's width.
        wraps: which axes of the grid of hypotheses go round.

    Raises:
        ValueError: no demonstrations, or shapes that disagree.
    """

    shown: tuple[Shown, ...]
    shape: tuple[int, ...]
    inside: Bools
    positions: Floats
    wraps: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        if not self.shown:
            raise ValueError("a problem needs demonstrations, and there are none")
        states, count = self.shown[0].agent.table.states, self.inside.shape[-1]
        shapes = [each.violated.shape for each in self.shown]
        fits = self.inside.shape == (states, count) and set(shapes) == {(count,)}
        if not fits or count < np.prod(self.shape):
            raise ValueError(
                f"{states} states and hypotheses {self.shape} do not fit inside "
                f"{self.inside.shape} and violated {sorted(set(shapes))}"
            )

    @property
    def regions(self) -> int:
        """C."""
        return int(self.inside.shape[1])

    @cached_property
    def violated(self) -> Bools:
        """(N, C) which hypotheses each demonstration violates."""
        return np.array([each.violated for each in self.shown])

    @cached_property
    def feasible(self) -> Bools:
        """(C,) hypotheses that no demonstration violates."""
        return ~np.any(self.violated, axis=0)

    @cached_property
    def tasks(self) -> list[tuple[Agent, list[int]]]:
        """Each different agent, and the numbers of its demonstrations."""
        found: dict[int, tuple[Agent, list[int]]] = {}
        for j, each in enumerate(self.shown):
            found.setdefault(id(each.agent), (each.agent, []))[1].append(j)
        return list(found.values())

    @cached_property
    def neighbours(self) -> scipy.sparse.csr_matrix:
        """(C, C) symmetric mask: hypotheses that share a side."""
        number = np.arange(int(np.prod(self.shape))).reshape(self.shape)
        rows, columns = [], []
        for axis, wraps in enumerate(self.wraps or (False,) * len(self.shape)):
            after = np.roll(number, -1, axis)
            last = slice(None) if wraps and self.shape[axis] > 2 else slice(0, -1)
            where = (slice(None),) * axis + (last,)
            rows.append(number[where].ravel())
            columns.append(after[where].ravel())
        row, column = np.concatenate(rows), np.concatenate(columns)
        shape = self.regions, self.regions
        one_way = scipy.sparse.csr_matrix((np.ones(len(row)), (row, column)), shape=shape)
        return scipy.sparse.csr_matrix(one_way + one_way.T)

    def moves_inside(self, number: int) -> Floats:
        """(C,) how many moves of a demonstration belong to each hypothesis.

        Where its path follows no moves of the table, its states in a hypothesis count, and at least
        one where the path violates it.
        """
        each = self.shown[number]
        if each.actions is None:
            return np.maximum(np.sum(self.inside[each.states], axis=0), each.violated)
        rows = each.states[:-1] * each.agent.table.actions + each.actions
        return np.asarray(each.agent.table.crosses[rows].sum(axis=0), dtype=float).ravel()
