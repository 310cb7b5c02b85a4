"""What follows each move of a finite world: one array of probabilities, from any form."""

from __future__ import annotations

import numpy as np
import scipy  # loads scipy.sparse when it is first used
from numpy.typing import ArrayLike

from mlci.spaces import Ints

WRITTEN = 1e-6  # how far probabilities in few digits, or of float32, may be from adding up to 1
ROUNDING = 1e-9  # those that are nearer are as they should be; others are scaled
MOST_MOVES = 200_000_000  # S * A: arrays of that many numbers take gigabytes


def as_transitions(transitions: ArrayLike | scipy.sparse.csr_matrix) -> scipy.sparse.csr_matrix:
    """Sparse probabilities (S * A, S) of what follows action a in state s, in row s * A + a.

    Args:
        transitions: whole numbers (S, A), -1 where there is no move; probabilities (S, A, S); or
            such a sparse array.

    Raises:
        ValueError: another shape, successors that are no states, probabilities that are negative or
            do not add up to 1, or to 0. In a sparse array, indices that are out of range.
    """
    if scipy.sparse.issparse(transitions):
        given = scipy.sparse.csr_matrix(transitions)
        if given.dtype.kind not in "biuf":
            raise ValueError(f"transitions are real numbers, not {given.dtype}")
        chances = given.astype(float, copy=True)
        chances.check_format(full_check=True)  # else what is out of range is read all the same
    else:
        array = np.asarray(transitions)
        if array.ndim == 2 and array.dtype.kind in "iu":
            chances = _certain(array)
        elif array.ndim == 3 and array.shape[0] == array.shape[2] and array.dtype.kind in "biuf":
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
    count = np.diff(chances.indptr)
    owner = np.repeat(np.arange(len(count)), count)
    if not np.all(fine := chances.data >= 0):  # nan is neither
        wrong, k = chances.data, int(np.argmin(fine))
        raise ValueError(f"{_move(owner[k], chances)} has the probability {wrong[k]:g}")
    total = np.asarray(chances.sum(axis=1)).ravel()
    off = np.where(count > 0, np.abs(total - 1), 0)
    if not np.all(off <= WRITTEN):
        worst = int(np.argmax(off))
        raise ValueError(
            f"probabilities of what follows {_move(worst, chances)} must add up to 1, not "
            f"{total[worst]:.9g}; a state where it cannot be taken has zeros alone"
        )
    if np.any(scaled := off > ROUNDING):
        chances.data /= np.where(scaled, total, 1.0)[owner]
    return chances


def _move(row: int, chances: scipy.sparse.csr_matrix) -> str:
    """What a message calls the move of a row."""
    state, action = divmod(int(row), chances.shape[0] // chances.shape[1])
    return f"action {action} in state {state}"


def _certain(successor: Ints) -> scipy.sparse.csr_matrix:
    """(S * A, S) with a 1 for each successor (S, A) that is not -1."""
    flat = successor.ravel()
    there = flat != -1
    in_range(flat[there], len(successor), "successors")
    begins = np.append(0, np.cumsum(there))
    shape = len(flat), len(successor)
    return scipy.sparse.csr_matrix((np.ones(begins[-1]), flat[there], begins), shape=shape)


def in_range(numbers: ArrayLike, count: int, what: str) -> Ints:
    """The same numbers, as an array.

    Raises:
        ValueError: one that is not whole, negative, or as large as the count; `what` names them.
    """
    given = np.asarray(numbers)
    if not given.size:
        return given.astype(np.int64)
    with np.errstate(invalid="ignore"):  # nan and inf are seen below
        array = given.astype(np.int64) if given.dtype.kind in "iuf" else np.zeros_like(given, int)
    if given.dtype.kind not in "iuf" or not np.all(fine := array == given):
        odd = given.ravel()[0] if given.dtype.kind not in "iuf" else given[~fine].ravel()[0]
        raise ValueError(f"{what} must be whole numbers from 0 to {count - 1}, not {odd}")
    if not (array.min() >= 0 and array.max() < count):
        odd = array[(array < 0) | (array >= count)].ravel()[0]
        raise ValueError(f"{what} must be from 0 to {count - 1}, not {odd}")
    return array


def check_steps(steps: int, who: str) -> None:
    """Raise ValueError unless a number of steps is whole and at least 1; `who` needs them."""
    if not isinstance(steps, int | np.integer) or steps < 1:
        raise ValueError(f"{who} needs a whole number of steps, at least one, not {steps}")
