"""What follows each move of a finite world: one array of probabilities, from any form."""

from __future__ import annotations

import numpy as np
import scipy  # loads scipy.sparse when it is first used
from numpy.typing import ArrayLike

from mlci.spaces import Ints

ROUNDING = 1e-9  # how far probabilities may be from adding up to 1


def as_transitions(transitions: ArrayLike | scipy.sparse.csr_matrix) -> scipy.sparse.csr_matrix:
    """Sparse probabilities (S * A, S) of what follows action a in state s, in row s * A + a.

    Args:
        transitions: whole numbers (S, A), -1 where there is no move; probabilities (S, A, S); or
            such a sparse array.

    Raises:
        ValueError: another shape, successors that are no states, probabilities that are negative or
            do not add up to 1, or to 0.
    """
    if scipy.sparse.issparse(transitions):
        chances = scipy.sparse.csr_matrix(transitions, dtype=float, copy=True)
    else:
        array = np.asarray(transitions)
        if array.ndim == 2 and array.dtype.kind in "iu":
            chances = _certain(array)
        elif array.ndim == 3 and array.shape[0] == array.shape[2]:
            chances = scipy.sparse.csr_matrix(array.reshape(-1, array.shape[2]).astype(float))
        else:
            raise ValueError(
                "transitions are whole numbers (S, A), probabilities (S, A, S) or a sparse "
                f"(S * A, S), not {array.dtype} {array.shape}"
            )
    if not chances.shape[1] or chances.shape[0] % chances.shape[1] or not chances.shape[0]:
        raise ValueError(f"sparse transitions have the shape (S * A, S), not {chances.shape}")
    chances.sum_duplicates()
    chances.eliminate_zeros()
    total = np.asarray(chances.sum(axis=1)).ravel()
    moves = np.diff(chances.indptr) > 0
    if not (np.all(chances.data >= 0) and np.all(np.abs(total[moves] - 1) <= ROUNDING)):
        worst = int(np.argmax(np.where(moves, np.abs(total - 1), 0)))
        raise ValueError(
            "probabilities of transitions must not be negative, and those of a move add up to 1; "
            f"row {worst} adds up to {total[worst]:g}"
        )
    return chances


def _certain(successor: Ints) -> scipy.sparse.csr_matrix:
    """(S * A, S) with a 1 for each successor (S, A) that is not -1."""
    flat = successor.ravel()
    there = flat != -1
    in_range(flat[there], len(successor), "successors")
    begins = np.append(0, np.cumsum(there))
    shape = len(flat), len(successor)
    return scipy.sparse.csr_matrix((np.ones(begins[-1]), flat[there], begins), shape=shape)


def in_range(numbers: Ints, count: int, what: str) -> Ints:
    """The same numbers.

    Raises:
        ValueError: one that is negative, or as large as the count; `what` names them.
    """
    if numbers.size and not (numbers.min() >= 0 and numbers.max() < count):
        raise ValueError(f"{what} must be from 0 to {count - 1}, not {numbers.tolist()}")
    return numbers
