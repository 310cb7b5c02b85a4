"""The most probable area of a ranking: the best region, and what of its neighbourhood is as good.

Where several regions explain demonstrations about equally, their order says little. An *area* is a
best region with all others that hang together with it by common borders and are at least half as
probable. Of best regions that tie each has its area, and these count alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.evidence import TIE
from mlci.spaces import Bools, Floats, Ints

HALF = float(np.log(2.0))  # nat: what is this much below the best is half as probable


@dataclass(frozen=True, eq=False)
class AreaScores:
    """How the most probable area of each of B rankings compares with what is good.

    Attributes:
        overlap: (B,) whether it has a good region; between 0 and 1 where best regions tie.
        precision: (B,) share of its regions that are good.
        share: (B,) share of all regions that it takes.
    """

    overlap: Floats
    precision: Floats
    share: Floats


def most_probable_area(
    gain: Floats, neighbours: scipy.sparse.csr_matrix, below: float = HALF
) -> Bools:
    """(C,) the regions of the area of the best region, the first one where several tie."""
    members, group = _groups(gain, neighbours, below)
    best = group[np.searchsorted(members, int(np.argmax(gain)))]
    mask = np.zeros(len(gain), dtype=bool)
    mask[members[group == best]] = True
    return mask


def area_scores(
    gains: Floats, neighbours: scipy.sparse.csr_matrix, good: Bools, below: float = HALF
) -> AreaScores:
    """Compare the most probable areas of rankings with good regions.

    Args:
        gains: (B, C) gains [nat], such as of random subsets of demonstrations.
        neighbours: (C, C) sparse mask, as of `mlci.credible_sets.neighbours`.
        good: (C,) which regions count, such as those that overlap the truth.
        below: how far below the best gain a region of an area may be [nat].
    """
    rows = np.array([_scores(gain, neighbours, good, below) for gain in gains])
    return AreaScores(*rows.reshape(-1, 3).T)


def _scores(
    gain: Floats, neighbours: scipy.sparse.csr_matrix, good: Bools, below: float
) -> tuple[float, float, float]:
    """Overlap, precision and share of one ranking's most probable area."""
    best = np.max(gain)
    members, group = _groups(gain, neighbours, below)
    size, hits = np.bincount(group), np.bincount(group, good[members])
    # The area of each best region; with an infinite gain only equals tie.
    mine = group[(gain[members] == best) | (gain[members] >= best - TIE)]
    overlap, precision = hits[mine] > 0, hits[mine] / size[mine]
    return float(overlap.mean()), float(precision.mean()), float(np.mean(size[mine]) / len(gain))


def _groups(gain: Floats, neighbours: scipy.sparse.csr_matrix, below: float) -> tuple[Ints, Ints]:
    """Numbers of the regions that are good enough, and of the area that each belongs to."""
    best = np.max(gain)
    members = np.flatnonzero((gain >= best - below) | (gain == best))
    from scipy.sparse import csgraph

    _, group = csgraph.connected_components(neighbours[members][:, members], directed=False)
    return members, group
