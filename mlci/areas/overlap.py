"""The area that is expected to overlap best with what is forbidden, under a belief.

Overlap is intersection over union, IoU. Neither the most probable area nor all that is more likely
forbidden than not has the largest expected overlap. It is climbed: to first order, a point raises
the expected overlap of an area A with draws B if sum over draws with it of 1 / |A u B| is above the
sum over draws without it of |A n B| / |A u B|^2; the area is then set to those that do.
"""

from __future__ import annotations

import numpy as np

from mlci.spaces import Bools, Floats

_SHARES = np.arange(1, 20) / 20  # of the belief: from the best area of points above one, it climbs
_STEPS = 50  # at most; each raises the expected overlap, and a handful are enough
_RISE = 1e-9  # of the expected overlap: what is less is rounding


def expected_overlap(area: Bools, draws: Bools, probability: Floats) -> float:
    """Expected IoU of an area (P,) of equal points with draws (B, P) of probabilities (B,).

    Of nothing with nothing it is 1.
    """
    return _overlap(area.astype(float), draws.astype(float), probability)


def best_area(draws: Bools, probability: Floats) -> tuple[Bools, float]:
    """The area (P,) whose expected IoU with draws (B, P) is largest, and that IoU.

    The largest that is met: no area is above it that differs in a single step of the climb.
    """
    inside = draws.astype(float)
    chance = probability @ inside
    starts = [(chance > share).astype(float) for share in _SHARES]
    overlaps = [_overlap(start, inside, probability) for start in starts]
    area, best = starts[int(np.argmax(overlaps))], max(overlaps)
    for _ in range(_STEPS):
        shared, union = _counts(area, inside)
        union = np.maximum(union, 1)
        here, elsewhere = probability / union, probability * shared / union**2
        larger = ((here + elsewhere) @ inside > np.sum(elsewhere)).astype(float)
        overlap = _overlap(larger, inside, probability)
        if overlap <= best + _RISE:
            break
        area, best = larger, overlap
    return area > 0, best


def _counts(area: Floats, inside: Floats) -> tuple[Floats, Floats]:
    """Points (B,) of draws (B, P) that an area (P,) shares, and of the union of both."""
    shared = inside @ area
    return shared, np.sum(inside, axis=1) + np.sum(area) - shared


def _overlap(area: Floats, inside: Floats, probability: Floats) -> float:
    """See `expected_overlap`."""
    shared, union = _counts(area, inside)
    return float(probability @ np.where(union > 0, shared / np.maximum(union, 1), 1.0))
