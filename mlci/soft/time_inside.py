"""How long moves and recorded paths are inside a region.

A path of chords is inside from where a chord enters the region to where it leaves it
(`mlci.shapes.shape.Shape.spans`). A chord takes its share of the move's time: exact on the
polyline, which strays from the curve by a hundredth of a cell at most (`mlci.tabular`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mlci.crossings import stays
from mlci.regions import Regions
from mlci.simulate import rollout
from mlci.spaces import Floats
from mlci.tabular import TabularModel


def time_inside(regions: Regions, path: ArrayLike, times: ArrayLike) -> Floats:
    """(C,) time that a recorded path spends inside each region [s].

    Args:
        regions: the C regions.
        path: (K+1, n) path of at least two samples, wrapped or not.
        times: (K+1,) of its samples [s], rising.
    """
    each = stays(regions, path, times)
    inside = np.bincount(each.region, each.end - each.begin, minlength=len(regions))
    return np.asarray(inside, dtype=float)


def path_times(regions: Regions, region: int, paths: Floats, dt: float) -> Floats:
    """(L,) time that paths (L, K+1, n) of dt [s] each spend inside a region [s].

    Args:
        regions: the C regions.
        region: number of one of them.
        paths: whose chords take equal times, not wrapped.
        dt: duration of each path.
    """
    count, chords, n = len(paths), paths.shape[1] - 1, paths.shape[2]
    starts = regions.space.wrap(paths[:, :-1]).reshape(-1, n)
    steps = np.diff(paths, axis=1).reshape(-1, n)
    parts = regions.shape(region).spans(regions.space, starts, steps)
    share = (parts.leave - parts.enter) / chords
    return np.asarray(dt * np.bincount(parts.chord // chords, share, minlength=count), dtype=float)


def move_times(model: TabularModel, region: int) -> Floats:
    """(S, M) time that each move of each cell spends inside a region [s].

    Args:
        model: the tabular model, whose moves follow its dynamics.
        region: number of one of its regions.
    """
    parts = []
    for cells in model.blocks():
        cell, move = np.repeat(cells, model.moves), np.tile(np.arange(model.moves), len(cells))
        action = model.actions[model.action[move]]
        origin = model.move_origins(cell, move)
        paths = rollout(model.system, origin, action[:, None, :], model.dt, model.substeps)
        times = path_times(model.regions, region, paths, model.dt)
        parts.append(times.reshape(len(cells), model.moves))
    return np.concatenate(parts)
