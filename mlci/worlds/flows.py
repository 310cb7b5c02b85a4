"""What goes along the edges of a graph of states: who is reached, and sums over all ways."""

from __future__ import annotations

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.spaces import Bools, Floats, Ints

_POWERS = 200  # steps of a power iteration whose result a message names
_DIRECT = 1000  # states up to which elimination is quick whatever leads where
_TERMS = 400  # of a series that is summed at most


def reached(seeds: Ints, begin: Ints, end: Ints, states: int) -> Bools:
    """(S,) the states that edges from `begin` (L,) to `end` (L,) lead to from some seeds."""
    marked = np.zeros(states, dtype=bool)
    marked[seeds] = True
    for _ in range(states):
        before = np.count_nonzero(marked)
        marked[end[marked[begin]]] = True
        if np.count_nonzero(marked) == before:
            break
    return marked


def fixed_point(flow: scipy.sparse.csr_matrix, source: Floats) -> Floats:
    """The x (S,) with x = flow x + source; nan where the system is singular.

    No flow is negative. With pivots on the diagonal alone, elimination then adds numbers of one
    sign, so that each x of sources >= 0 keeps its digits beside others that are far larger. In a
    large graph without a plane or another order elimination fills the matrix, so that the series of
    such sources is summed first, which has as good digits, and is taken if it converges soon.
    """
    if not len(source):
        return np.empty(0)
    if len(source) > _DIRECT and np.all(source >= 0):
        total = _series(flow, source)
        if total is not None:
            return total
    from scipy.sparse.linalg import splu  # loads scipy.linalg, only where it is used

    system = scipy.sparse.identity(len(source), format="csc") - flow
    order = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
    try:
        return np.asarray(splu(system.tocsc(), diag_pivot_thresh=0.0, **order).solve(source))
    except RuntimeError:  # singular
        return np.full(len(source), np.nan)


def _series(flow: scipy.sparse.csr_matrix, source: Floats) -> Floats | None:
    """The sum of lazy^k source / 2 with lazy = (I + flow) / 2, whose terms skip no state in turns.

    None where a term is not below rounding after so many. Where one is, terms shrink by a tenth or
    so each, and what is left out is some ten times the last.
    """
    rows, term = scipy.sparse.csr_matrix(flow), source / 2
    total, rounding = term.copy(), np.finfo(float).eps / 10
    with np.errstate(over="ignore", invalid="ignore"):  # of a series that diverges
        for _ in range(_TERMS):
            term = (term + rows @ term) / 2
            total += term
            if np.all(term <= rounding * total):
                return np.asarray(total)
    return None


def spectral_radius(flow: scipy.sparse.csr_matrix) -> float:
    """About the spectral radius of a flow (S, S) of numbers >= 0, by power iteration."""
    vector, growth = np.ones(flow.shape[0]), 0.0
    for _ in range(_POWERS):  # of (I + flow) / 2, since the flow itself may be periodic
        vector = (vector + flow @ vector) / 2
        growth = float(np.max(vector))
        vector /= growth
    return 2 * growth - 1
