"""Small tables of single points, for the figures that show one example rather than a sweep.

Collating makes them for every study, a part for each truth: they are what is left of tables that
grow with the number of points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import pandas as pd

if TYPE_CHECKING:
    from experiments.record import Point

# The point that stands for a truth: these values, or the nearest that the study holds.
CELLS, DT, ACTIONS = 400, 0.25, 9

_PATH_EVERY = 2  # samples of the table `paths` between those that are drawn
_DECIMALS = 4  # of coordinates that are only drawn


def example_tables(points: Sequence[Point]) -> dict[str, pd.DataFrame]:
    """The tables of a study's examples.

    Args:
        points: finished points, in the order of the study's tables.

    Returns:
        `example_ranking`, the table `hypotheses` of one point a truth, with its identity; and
        `example_paths`, its demonstrations, thinned out.
    """
    truths = sorted({point.settings.truth.name for point in points})
    chosen = [
        min((point for point in points if point.settings.truth.name == truth), key=_distance)
        for truth in truths
    ]
    return {
        "example_ranking": pd.concat([_ranking(point) for point in chosen], ignore_index=True),
        "example_paths": pd.concat([_paths(point) for point in chosen], ignore_index=True),
    }


def _distance(point: Point) -> tuple[float, ...]:
    """How far a point is from the example; the first difference decides."""
    settings = point.settings
    return (
        abs(math.prod(settings.grid.shape) - CELLS),
        abs(settings.dt - DT),
        abs(math.prod(settings.action_counts) - ACTIONS),
        settings.transition.samples,
        settings.seed,
    )


def _ranking(point: Point) -> pd.DataFrame:
    """The ranked hypotheses of a point."""
    table = pd.read_csv(point.folder / "hypotheses.csv")
    table.insert(0, "point", point.identity)
    return table


def _paths(point: Point) -> pd.DataFrame:
    """The demonstrations of a point, of each every other sample and the last."""
    table = pd.read_csv(point.folder / "paths.csv")
    place = table.groupby("demonstration").cumcount()
    last = table.groupby("demonstration")["time"].transform("max") == table["time"]
    return table[(place % _PATH_EVERY == 0) | last].round(_DECIMALS)
