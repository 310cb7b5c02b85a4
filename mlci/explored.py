"""What a tabular model that has the moves of some cells alone can be asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.spaces import Bools, Ints


@dataclass(frozen=True, eq=False)
class Explored:
    """The cells whose moves a model has, see `mlci.exploration`.

    Attributes:
        cells: (S,) mask of them.
        ways: what they serve: first cells, the number of moves from there, and goal cells.
    """

    cells: Bools
    ways: tuple[tuple[Ints, int, Ints], ...]

    def serves(self, starts: Ints, steps: int, goal: Ints) -> bool:
        """Whether they are all that can be occupied on a way from starts to a goal."""
        return any(
            steps == known and np.isin(starts, first).all() and np.isin(goal, last).all()
            for first, known, last in self.ways
        )
