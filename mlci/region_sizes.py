"""Sizes of regions, and prior weights by them.

A larger region lies on the way of more paths, so that keeping out of it explains more, whether or
not all of it is forbidden. Where regions differ in size a prior can weigh against that.
"""

from __future__ import annotations

import numpy as np

from mlci.regions import Regions
from mlci.shapes.membership import volume_share
from mlci.spaces import Bools, Floats

_LEAST = 1e-15  # share of a volume: its largest power is still a number
LARGEST_POWER = 20.0  # a region of half the size is then a million times as probable


def region_sizes(regions: Regions) -> Floats:
    """Size (C,) of each region: the share of the state space's volume that it holds."""
    bounds, periodic = regions.space.bounds, regions.space.periodic
    lower = np.where(periodic, regions.lower, np.maximum(regions.lower, bounds.lower))
    upper = np.where(periodic, regions.upper, np.minimum(regions.upper, bounds.upper))
    sizes = np.prod(np.clip((upper - lower) / bounds.widths, 0.0, 1.0), axis=1)
    for i in np.flatnonzero(~regions.are_boxes).tolist():
        sizes[i] = volume_share(regions.space, regions.shape(i))
    return np.asarray(sizes)


def weights_by_size(regions: Regions, power: float) -> Floats | None:
    """Prior weights (C,): size to the power of -power, 0 for a region outside the bounds.

    A power of 1 makes a region of half the size twice as probable. One of 0 makes all equally
    probable, and the weights None.

    Raises:
        ValueError: a power below 0, or above `LARGEST_POWER`; or a region within the bounds that is
            too small to have a size.
    """
    if not 0 <= power <= LARGEST_POWER:
        raise ValueError(
            f"the power of a prior by size lies between 0 and {LARGEST_POWER:g}, not {power}; 1 "
            "makes a region of half the size twice as probable"
        )
    if power == 0:
        return None
    sizes, within = region_sizes(regions), _within_bounds(regions)
    if (tiny := np.flatnonzero(within & (sizes < _LEAST))).size:
        raise ValueError(
            f"region {regions.names[tiny[0]]} holds {sizes[tiny[0]]:.2g} of the state space, less "
            f"than the {_LEAST:g} that a prior by size can weigh; make it larger, or take the "
            "power 0"
        )
    weights = np.zeros(len(sizes))
    weights[within] = sizes[within] ** -power
    return weights


def _within_bounds(regions: Regions) -> Bools:
    """(C,) whether a region's hull reaches into the bounds, wherever it is if it wraps."""
    bounds = regions.space.bounds
    reaches = (regions.lower < bounds.upper) & (regions.upper > bounds.lower)
    return np.all(regions.space.periodic | reaches, axis=1)
