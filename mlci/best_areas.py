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
    group = _groups(gain[None], neighbours, below)[0]
    return group == group[int(np.argmax(gain))]


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
    group, count = _groups(gains, neighbours, below), gains.shape[1]
    size = np.bincount(group.ravel())[group]
    hits = np.bincount(group.ravel(), np.broadcast_to(good, gains.shape).ravel())[group]
    # The area of each best region; with an infinite gain only equals tie.
    best = np.max(gains, axis=1, keepdims=True)
    is_best = (gains == best) | (gains >= best - TIE)
    overlap, precision, share = (
        np.mean(values, axis=1, where=is_best) for values in (hits > 0, hits / size, size / count)
    )
    return AreaScores(overlap, precision, share)


def _groups(gains: Floats, neighbours: scipy.sparse.csr_matrix, below: float) -> Ints:
    """(B, C) number of the area that a region belongs to; what is not good enough is alone."""
    best = np.max(gains, axis=1, keepdims=True)
    is_member = (gains >= best - below) | (gains == best)
    first, second = scipy.sparse.triu(neighbours, 1).nonzero()
    ranking, pair = np.nonzero(is_member[:, first] & is_member[:, second])
    from scipy.sparse import csgraph

    ends = [ranking * gains.shape[1] + side[pair] for side in (first, second)]
    borders = scipy.sparse.coo_matrix((np.ones(len(pair), bool), ends), (gains.size, gains.size))
    _, group = csgraph.connected_components(borders, directed=False)
    return np.asarray(group, dtype=np.int64).reshape(gains.shape)
