"""Moves of cells, one by one: each action from each start point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.spaces import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class SingleMoves:
    """The M moves of each of Q cells.

    Attributes:
        successor: (Q, M) cell after a move, int32; -1 where it leaves the grid.
        reward: (Q, M) reward of a move, r dt / temperature [nat].
        crosses: (Q * M, C) sparse boolean: row q * M + move, the regions its path enters.

    Raises:
        ValueError: arrays whose shapes disagree.
    """

    successor: Ints
    reward: Floats
    crosses: scipy.sparse.csr_matrix

    def __post_init__(self) -> None:
        shape = self.successor.shape
        if not (
            len(shape) == 2
            and self.reward.shape == shape
            and self.crosses.shape[0] == shape[0] * shape[1]
        ):
            raise ValueError(
                f"successor {shape}, reward {self.reward.shape} and crosses {self.crosses.shape} "
                "do not agree"
            )
        object.__setattr__(self, "successor", np.ascontiguousarray(self.successor, dtype=np.int32))
        object.__setattr__(self, "reward", np.ascontiguousarray(self.reward, dtype=float))

    @classmethod
    def joined(cls, parts: Sequence[SingleMoves]) -> SingleMoves:
        """The moves of the cells of all parts, in order."""
        return cls(
            np.concatenate([part.successor for part in parts]),
            np.concatenate([part.reward for part in parts]),
            scipy.sparse.vstack([part.crosses for part in parts], format="csr"),
        )

    def of(self, cells: Ints) -> SingleMoves:
        """The moves of some of the cells (Q',)."""
        return SingleMoves(self.successor[cells], self.reward[cells], self._rows(cells))

    def allowed(self, truth: Bools) -> Bools:
        """(Q, M) whether a move stays in the grid and out of the truth, a mask (C,) of regions."""
        crossed = (self.crosses @ truth).reshape(self.successor.shape)
        return np.asarray((self.successor >= 0) & ~crossed)

    def allowed_reward(self, truth: Bools) -> Floats:
        """(Q, M) reward of a move, -inf where it is not allowed."""
        return np.where(self.allowed(truth), self.reward, -np.inf)

    def _rows(self, cells: Ints) -> scipy.sparse.csr_matrix:
        """The rows of `crosses` that belong to some cells."""
        moves = self.successor.shape[1]
        return self.crosses[(cells[:, None] * moves + np.arange(moves)).ravel()]
