"""Whether the weight of a soft constraint can be told: sets of demonstrations of known weight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.streams import Purpose, stream
from mlci.maxent import TrajectoryDistribution
from mlci.soft.distribution import SoftModel, soften
from mlci.soft.weight import SoftShares, tabulate_shares
from mlci.spaces import Floats

COLUMNS = ["weight", "demonstrations", "set", "estimate", "lower", "upper", "gain", "hard_to_soft"]
COLUMNS += ["verdict", "time_inside", "expected_time"]


def soft_table(settings: Settings, point: PointInference) -> pd.DataFrame:
    """A row a weight, number of demonstrations and set: the weight that is estimated.

    Tasks are the point's. Of each the tabular model under the weight draws one trajectory a set,
    from cell to cell, whose moves tell how long they are inside the truth's first region.

    Returns:
        `weight` that is true [nat/s]; `demonstrations` and number of the `set`; `estimate`, its
        `lower` and `upper` end, infinite for a wall; `gain` over none and `hard_to_soft` [nat];
        `verdict`; mean `time_inside`, and `expected_time` without a constraint [s].
    """
    region = int(np.flatnonzero(point.truth)[0])
    softened = soften(point.tabular, region)
    possible = [
        each
        for each in (
            TrajectoryDistribution.of_task(point.tabular, demonstration.task)
            for demonstration in point.demonstrations
        )
        if each.is_possible
    ]
    if not possible:
        return pd.DataFrame(columns=COLUMNS)
    shares = tabulate_shares([softened.task(each) for each in possible])
    rows = []
    for number, weight in enumerate(settings.soft.weights):
        times = _drawn_times(settings, softened, possible, number)
        for row in _estimates(settings, shares, times, number):
            rows.append({"weight": weight, **row})
    return pd.DataFrame(rows, columns=COLUMNS)


def _drawn_times(
    settings: Settings, softened: SoftModel, tasks: list[TrajectoryDistribution], number: int
) -> Floats:
    """(sets, tasks) time inside of a trajectory of each task under a weight, by its number."""
    under, sets = softened.under(settings.soft.weights[number]), settings.soft.sets
    columns = []
    for place, task in enumerate(tasks):
        rng = stream(settings.seed, Purpose.SOFT, number, place)
        cells, moves = replace(task, model=under).sample(sets, rng)
        columns.append(np.sum(softened.times[cells[:, :-1], moves], axis=1))
    return np.stack(columns, axis=1)


def _estimates(
    settings: Settings, shares: SoftShares, times: Floats, number: int
) -> Iterator[dict[str, object]]:
    """The estimate of each set of each size; the tasks of a set are drawn at random."""
    for size in settings.soft.demonstrations:
        for k in range(settings.soft.sets):
            rng = stream(settings.seed, Purpose.SOFT, number, k, size)
            chosen = rng.permutation(times.shape[1])[:size]
            estimate = shares.of(chosen).estimate(times[k, chosen])
            yield {
                "demonstrations": len(chosen),
                "set": k,
                "estimate": estimate.weight,
                "lower": estimate.lower,
                "upper": estimate.upper,
                "gain": estimate.gain,
                "hard_to_soft": estimate.hard_to_soft,
                "verdict": estimate.verdict,
                "time_inside": estimate.time_inside,
                "expected_time": estimate.expected_time,
            }
