"""What a tabular model asks of its cells, whether they are equal or not."""

from __future__ import annotations

from typing import Protocol

from numpy.typing import ArrayLike

from mlci.spaces import Box, Floats, Ints, StateSpace


class Cells(Protocol):
    """S cells that cover a state space of n dimensions, each a box with a number."""

    @property
    def space(self) -> StateSpace:
        """The state space that is covered."""

    @property
    def size(self) -> int:
        """S, the number of cells."""

    @property
    def widths(self) -> Floats:
        """(n,) side lengths of a cell; where they differ, their geometric mean."""

    @property
    def centers(self) -> Floats:
        """(S, n) centre of every cell."""

    @property
    def corners(self) -> tuple[Floats, Floats]:
        """Lower and upper corner (S, n) of every cell."""

    def index(self, states: ArrayLike) -> Ints:
        """Number (...,) of the cell that holds each of states (..., n), -1 outside."""

    def points_inside(self, samples: int, cells: Ints) -> Floats:
        """(Q, samples^n, n): the centres of a regular subdivision of some cells (Q,)."""

    def cells_in(self, region: Box) -> Ints:
        """Numbers of the cells that a region meets, sorted."""


def check_has_cells(model: object) -> None:
    """See that a model has one set of cells for all tasks.

    Raises:
        TypeError: it samples paths, or refines cells for each task.
    """
    if not hasattr(model, "grid"):
        raise TypeError(
            f"this needs a TabularModel; a {type(model).__name__} has no cells that all tasks "
            "share: take a TabularModel of equal cells"
        )
