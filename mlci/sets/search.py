"""A set of constraints that is built up region by region: greedily, or with a beam.

What is searched is told by one function: by how much each of some candidates lowers what is to be
lowered, given a mask of those added. A beam keeps the best few sets of each size, so that it also
meets sets whose first region is not the best alone; of width 1 it is greedy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mlci.evidence import TIE
from mlci.spaces import Bools, Floats, Ints

if TYPE_CHECKING:
    import pandas as pd

_Set = tuple[tuple[int, ...], tuple[float, ...]]  # hypotheses in order, and their decreases


Decreases = Callable[[Bools, Ints], Floats]


@dataclass(frozen=True, eq=False)
class Selection:
    """Constraints in the order in which they were added.

    Attributes:
        names: (C,) names of the hypotheses.
        added: (K,) those added, in order.
        decrease: (K,) by how much each lowers the divergence of demonstrations from the
            distribution, given those before [nat for each demonstration]: it is the mean log
            likelihood gain.
        next_decrease: by how much the best of the rest would have, where nothing more was added; 0
            where none was left.
        nominal_kl: the divergence without constraints; nan where it is not known, as of paths in a
            continuous space.
    """

    names: tuple[str, ...]
    added: Ints
    decrease: Floats
    next_decrease: float
    nominal_kl: float = np.nan

    @property
    def mask(self) -> Bools:
        """(C,) the hypotheses that were added, as `under` takes them."""
        return np.isin(np.arange(len(self.names)), self.added)

    @property
    def kl(self) -> Floats:
        """(K+1,) the divergence: without constraints, and after each [nat]."""
        return self.nominal_kl - np.cumsum(np.append(0.0, self.decrease))

    def to_frame(self) -> pd.DataFrame:
        """A row for each constraint in order: `hypothesis`, `decrease`, and `kl` after it."""
        import pandas as pd

        return pd.DataFrame(
            {
                "hypothesis": [self.names[i] for i in self.added],
                "decrease": self.decrease,
                "kl": self.kl[1:],
            }
        )


def search(
    decreases: Decreases, feasible: Bools, least: float, most: int | None = None, width: int = 1
) -> tuple[Ints, Floats, float]:
    """Add a hypothesis, again and again, as long as the best set of a size lowers enough.

    Args:
        decreases: by how much (L,) each of some candidates (L,) lowers what is to be lowered, given
            a mask (C,) of those added.
        feasible: (C,) the hypotheses that may be added.
        least: the decrease below or at which it stops, from the best set of one size to that of
            the next.
        most: how many to add at most; None adds as many as there are.
        width: how many sets of each size are kept; 1 adds the best of all each time.

    Returns:
        Those added (K,) in order, their decreases (K,), and the decrease that was too small.

    Raises:
        ValueError: a width below 1.
    """
    if least != least or (most is not None and most < 0):
        raise ValueError(f"least is a number, and most one from 0 up, not {least} and {most}")
    if width < 1:
        raise ValueError(f"a beam keeps at least one set, not {width}")
    beam: list[_Set] = [((), ())]
    while True:
        best, (added, steps) = sum(beam[0][1]), beam[0]
        larger = _larger(decreases, feasible, beam)
        if not larger:
            return np.array(added, dtype=np.int64), np.array(steps), 0.0
        beam = _best(larger, width)
        total = sum(beam[0][1])
        rise = 0.0 if total == best else total - best  # infinite ones are equal
        if rise <= least or len(added) == most:
            return np.array(added, dtype=np.int64), np.array(steps), float(rise)


def _larger(decreases: Decreases, feasible: Bools, beam: list[_Set]) -> list[_Set]:
    """Every set of the beam with each further hypothesis, each set once."""
    larger: dict[frozenset[int], _Set] = {}
    for added, steps in beam:
        mask = np.isin(np.arange(len(feasible)), added)
        candidates = np.flatnonzero(feasible & ~mask)
        if not len(candidates):
            continue
        for i, step in zip(candidates.tolist(), decreases(mask, candidates).tolist(), strict=True):
            larger.setdefault(frozenset((*added, i)), ((*added, i), (*steps, step)))
    return list(larger.values())


def _best(sets: list[_Set], width: int) -> list[_Set]:
    """The sets that lower most; of those that tie, the first ones."""
    total = np.array([sum(steps) for _, steps in sets])
    order: list[int] = []
    while len(order) < min(width, len(sets)):
        best = np.max(total)
        order.append(int(np.argmax((total > best - TIE) | (total == best))))  # also if infinite
        total[order[-1]] = -np.inf
    return [sets[place] for place in order]


def without_needless(
    decreases: Decreases, added: Ints, hypotheses: int, least: float
) -> tuple[Ints, Floats]:
    """Drop one after the other of what was added, as long as it costs no more than `least`.

    Args:
        decreases: as of `search`.
        added: (K,) numbers of hypotheses.
        hypotheses: C.
        least: the rise above which a hypothesis is kept.

    Returns:
        Those kept (K',) in their order, and the decrease (K',) that each brings after those before.
    """

    def decrease(others: list[int], candidate: int) -> float:
        mask = np.isin(np.arange(hypotheses), others)
        return float(decreases(mask, np.array([candidate]))[0])

    kept = added.tolist()
    while kept:
        rises = [decrease([other for other in kept if other != i], i) for i in kept]
        if min(rises) > least:
            break
        del kept[int(np.argmin(rises))]
    steps = [decrease(kept[:k], kept[k]) for k in range(len(kept))]
    return np.array(kept, dtype=np.int64), np.array(steps)
