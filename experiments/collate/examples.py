"""Small tables of single points, for the figures that show one example rather than a sweep.

Collating makes them for every study, a part for each truth, from tables of its points that are too
large to keep beside the study.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.collate.settings_of import settings_of
from experiments.point.tables import FIRST
from experiments.point.truth_tables import box_table
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.spaces import Ints

if TYPE_CHECKING:
    from experiments.tracking.points import Point


# The point that stands for a truth: these values, or the nearest that the study holds; of several,
# the one whose other settings most points have.
CELLS, DT, ACTIONS = 400, 0.25, 9
# The grids whose trajectories are compared, coarse to fine, or the nearest that the study holds.
COMPARED = (100, 900, 1600)

_MOST_TRUTHS = 4  # of a study that has examples: of more, they would be neither few nor small
_ENOUGH = 0.9  # of the demonstrations are feasible in all compared grids at a dt that can be chosen
_PATH_EVERY = 2  # samples of the table `paths` between those that are drawn of many paths
_DECIMALS = 4  # of paths, which are only drawn
_CORNER_DECIMALS = 6  # of boxes, likewise, whose edges meet


def example_tables(points: Sequence[Point]) -> dict[str, pd.DataFrame]:
    """The tables of a study's examples, each opened by truth and the settings of a point.

    Args:
        points: finished points, in the order of the study's tables.

    Returns:
        Of one point a truth, `example_ranking`, its table `hypotheses` with Phi of one trial;
        `example_paths`, its demonstrations, thinned out; `example_cells`, the cells of that
        trial's sampled trajectory; `example_moves`, the moves from these cells; and its own
        `example_regions` and `example_dimensions`. And of one trial a truth in several grids,
        `compared_cells`, `compared_violations` and `compared_paths`. And of one point a truth and
        kind of tasks, all of whose settings are those of most points, `first_ranking`,
        `first_paths` and `first_violations`: its first demonstrations, and what they tell. A study
        of many truths has none of these.
    """
    tables: dict[str, list[pd.DataFrame]] = {
        **{
            f"example_{name}": []
            for name in ("ranking", "paths", "cells", "moves", "regions", "dimensions")
        },
        **{f"compared_{name}": [] for name in ("cells", "violations", "paths")},
        **{f"first_{name}": [] for name in ("ranking", "paths", "violations")},
    }
    truths = sorted({_truth(point) for point in points})
    if len(truths) > _MOST_TRUTHS:
        return {}
    unusual = _unusual(points)
    for truth in truths:
        of_truth = [point for point in points if _truth(point) == truth]
        example = min(of_truth, key=lambda point: (*_distance(point), unusual[point.identity]))
        for name, table in _example(example).items():
            tables[name].append(table)
        trial, alike = _comparison(example, of_truth)
        for point in alike:
            tables["compared_cells"].append(_cells(point, trial))
            tables["compared_violations"].append(_violations(point, trial))
        path = _of_trial(_read(example, "paths"), trial, "demonstration")
        tables["compared_paths"].append(path.round(_DECIMALS))
        for crossing in sorted({settings_of(point).tasks.crossing for point in of_truth}):
            alike = [point for point in of_truth if settings_of(point).tasks.crossing == crossing]
            usual = min(alike, key=lambda point: (unusual[point.identity], settings_of(point).seed))
            for name, table in _first(usual).items():
                table.insert(0, "tasks.crossing", crossing)
                tables[f"first_{name}"].append(table)
    return {name: _joined(parts) for name, parts in tables.items()}


def _truth(point: Point) -> str:
    """The name of a point's truth in tables."""
    return str(settings_of(point).columns["truth"])


def _distance(point: Point) -> tuple[float, ...]:
    """How far a point is from the example; the first difference decides."""
    settings = settings_of(point)
    return (
        abs(math.prod(settings.grid.shape) - CELLS),
        abs(settings.dt - DT),
        abs(math.prod(settings.action_counts) - ACTIONS),
        settings.transition.samples,
        settings.seed,
    )


def _unusual(points: Sequence[Point]) -> dict[str, int]:
    """How many settings of each point are not those of most points, by its identity."""
    counts: dict[str, int] = dict.fromkeys((point.identity for point in points), 0)
    for field in fields(settings_of(points[0])):
        values = {point.identity: repr(getattr(settings_of(point), field.name)) for point in points}
        times = Counter(values.values())
        usual = min(times, key=lambda value: (-times[value], value))
        for identity, value in values.items():
            counts[identity] += value != usual
    return counts


def _example(point: Point) -> dict[str, pd.DataFrame]:
    """The tables of one point."""
    probabilities = _read(point, "probabilities")
    trial = int(probabilities["trial"].iloc[0]) if len(probabilities) else -1
    phi = probabilities[["hypothesis", "trial", "unconstrained", "constrained"]]
    ranking = _named(point, _read(point, "hypotheses")).merge(phi, on="hypothesis", how="left")
    paths = _read(point, "paths")
    place = paths.groupby("demonstration").cumcount()
    last = paths.groupby("demonstration")["time"].transform("max") == paths["time"]
    return {
        "example_ranking": ranking,
        "example_paths": paths[(place % _PATH_EVERY == 0) | last].round(_DECIMALS),
        "example_cells": _cells(point, trial),
        "example_moves": _moves(point),
        "example_regions": _read(point, "regions"),
        "example_dimensions": _read(point, "dimensions"),
    }


def _first(point: Point) -> dict[str, pd.DataFrame]:
    """The ranking by a point's first demonstrations, their paths and what each violates."""
    paths, violations = _read(point, "paths"), _read(point, "violations")
    first = sorted(paths["demonstration"].unique())[:FIRST]
    shown = violations["trial"].isin(first) & (violations["source"] == "demonstration")
    return {
        "ranking": _named(point, _read(point, "first")),
        "paths": paths[paths["demonstration"].isin(first)].round(_DECIMALS),
        "violations": _with_boxes(violations[shown], "hypothesis", _hypothesis_boxes(point)),
    }


def _comparison(example: Point, points: Sequence[Point]) -> tuple[int, list[Point]]:
    """The points that are compared, coarse to fine, and the trial; -1 if there is none for all.

    They differ from the example in the grid and, all alike, in dt: the dt nearest to the
    example's at which nearly all demonstrations are feasible in all of these grids, or, where
    there is none, the most. The trial is the one of them that passes nearest to the truth.
    """
    own = settings_of(example)
    by_dt: dict[float, list[Point]] = {}
    for point in points:
        if replace(settings_of(point), grid=own.grid, dt=own.dt) == own:
            by_dt.setdefault(settings_of(point).dt, []).append(point)
    enough = _ENOUGH * len(_read(example, "trials"))
    trials, alike = np.empty(0, dtype=np.int64), [example]
    for dt in sorted(by_dt, key=lambda dt: (abs(dt - own.dt), dt)):
        closest = [min(by_dt[dt], key=lambda p: abs(_count(p) - cells)) for cells in COMPARED]
        these = list({point.identity: point for point in closest}.values())
        found = _feasible_in_all(these)
        if len(found) > len(trials):
            trials, alike = found, these
        if len(trials) >= enough:
            break
    paths = _read(example, "paths")
    paths = paths[paths["demonstration"].isin(trials)]
    names = list(settings_of(example).model.space.names)
    distance = settings_of(example).constraint.signed_distance(paths[names].to_numpy())
    return (int(paths["demonstration"].iloc[np.argmin(distance)]) if len(paths) else -1), alike


def _count(point: Point) -> int:
    """Cells of a point's grid."""
    return math.prod(settings_of(point).grid.shape)


def _feasible_in_all(points: Sequence[Point]) -> Ints:
    """Trials whose goal the tabular agent reaches under the truth, at each of some points."""
    tables = [_read(point, "trials") for point in points]
    return np.array(
        sorted(set.intersection(*(set(table["trial"][table["feasible"]]) for table in tables))),
        dtype=np.int64,
    )


def _cells(point: Point, trial: int) -> pd.DataFrame:
    """The cells that a trial's sampled trajectory visits, with their corners."""
    visits = _named(point, _of_trial(_read(point, "sampled"), trial).copy())
    return _with_boxes(visits, "cell", _grid_boxes(settings_of(point).cells))


def _moves(point: Point) -> pd.DataFrame:
    """The moves of the cells that the first trajectory visits, with both cells' corners."""
    boxes = _grid_boxes(settings_of(point).cells)
    moves = _with_boxes(_read(point, "moves"), "cell", boxes)
    return _with_boxes(moves, "successor", boxes.add_prefix("successor_"))


def _violations(point: Point, trial: int) -> pd.DataFrame:
    """The hypotheses that a trial's demonstration and sampled trajectory violate, with corners."""
    return _with_boxes(
        _of_trial(_read(point, "violations"), trial), "hypothesis", _hypothesis_boxes(point)
    )


def _hypothesis_boxes(point: Point) -> pd.DataFrame:
    """The corners of every hypothesis."""
    return box_table("hypothesis", settings_of(point).candidates).drop(columns="hypothesis")


def _grid_boxes(grid: Grid) -> pd.DataFrame:
    """The corners of every cell of a grid."""
    return box_table("cell", Regions(grid.space, *grid.corners)).drop(columns="cell")


def _with_boxes(rows: pd.DataFrame, key: str, boxes: pd.DataFrame) -> pd.DataFrame:
    """Rows with the corners of the box that their column `key` numbers, as they are drawn."""
    return rows.join(boxes.round(_CORNER_DECIMALS), on=key)


def _of_trial(table: pd.DataFrame, trial: int, column: str = "trial") -> pd.DataFrame:
    """The rows of one trial."""
    return table[table[column] == trial]


def _read(point: Point, name: str) -> pd.DataFrame:
    """A table of a point."""
    return pd.read_csv(point.folder / f"{name}.csv")


def _named(point: Point, table: pd.DataFrame) -> pd.DataFrame:
    """A table opened by the point's identity."""
    table.insert(0, "point", point.identity)
    return table


def _joined(parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Tables below one another; the type of a column is not left to those without rows."""
    return pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)
