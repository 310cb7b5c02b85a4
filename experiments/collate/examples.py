"""Small tables of single points, for the figures that show one example rather than a sweep.

A study's YAML names them, and its plan keeps what it names:

    examples:
      ranking:
        - {cells: 400, dt: 0.25, actions: 9, seed: 0}
        - {cells: 100, dt: 0.1, actions: 9, seed: 0}
      compared:
        - {cells: [100, 900, 1600], dt: 0.5, actions: 9, seed: 0, trial: {c1: 3, c2: 52}}
      first:
        - {case: default, seed: 0}

`ranking` shows one point a truth; `compared`, one trial a truth in several points; `first`, the
first demonstrations of one point a truth and kind of tasks. Of the entries of each the first is
taken that the study has points for. An entry gives values to columns that open tables, to dotted
keys of the config or to `case`; a list allows several. Where an entry names no `trial`, it is the
first that the tabular agent can follow in all compared points.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from experiments.collate.finished import CollateError, FinishedPoint

FIRST = 5  # demonstrations that the points' table `first` is of

_PATH_EVERY = 2  # samples of the table `paths` between those that are drawn of many paths
_DECIMALS = 4  # of paths, which are only drawn
_CORNER_DECIMALS = 6  # of boxes, likewise, whose edges meet

Tables = dict[str, pd.DataFrame]
Entry = Mapping[str, Any]


def example_tables(
    points: Sequence[FinishedPoint],
    examples: Mapping[str, Sequence[Entry]],
    cases: Mapping[str, str],
    log: Callable[[str], None],
) -> Tables:
    """The tables of a study's examples, each opened by truth and the settings of a point.

    Args:
        points: the points, in the order of the study's tables; of several that an entry allows,
            the first is taken.
        examples: what the study names: a list of entries for `ranking`, `compared` and `first`.
        cases: the name of each point's case, by its identity.
        log: is told which examples are missing, a line each.

    Returns:
        For `ranking`: `example_ranking`, the table `hypotheses` with Phi of one trial;
        `example_paths`, the demonstrations, thinned out; `example_cells`, the cells of that trial's
        sampled trajectory; `example_moves`, the moves from these cells; `example_regions` and
        `example_dimensions`. For `compared`: `compared_cells`, `compared_violations` and
        `compared_paths`. For `first`: `first_ranking`, `first_paths` and `first_violations`, the
        first demonstrations and what they say. An example that is missing has no rows, and a table
        without any example is left out.

    Raises:
        CollateError: an example that there is no table for.
    """
    if unknown := sorted(set(examples) - set(_MAKERS)):
        raise CollateError(f"examples: {', '.join(unknown)}: there are {', '.join(_MAKERS)}")
    facts = {point.identity: _facts(point, cases) for point in points}
    parts: dict[str, list[pd.DataFrame]] = {}
    for kind, entries in examples.items():
        keys, make = _MAKERS[kind]
        groups: dict[tuple[Any, ...], list[FinishedPoint]] = {}
        for point in points:
            group = tuple(facts[point.identity][key] for key in keys)
            groups.setdefault(group, []).append(point)
        for group in sorted(groups):
            common = dict(zip(keys, group, strict=True))
            meant = [e for e in entries if _meets(common, {k: e[k] for k in keys if k in e})]
            tables = _first_example(groups[group], facts, meant, make)
            for name, table in tables.items():
                parts.setdefault(name, []).append(table)
            if meant and not tables:
                where = ", ".join(f"{key} {value}" for key, value in common.items())
                log(f"examples.{kind}: no point of {where} is as named, so it shows none")
    return {name: _below_one_another(tables) for name, tables in parts.items()}


def _first_example(
    points: Sequence[FinishedPoint],
    facts: Mapping[str, Entry],
    entries: Sequence[Entry],
    make: Callable[[Sequence[FinishedPoint], Any], Tables],
) -> Tables:
    """The tables of the first entry that there is an example for; else nothing."""
    for entry in entries:
        conditions = {key: value for key, value in entry.items() if key != "trial"}
        alike = [point for point in points if _meets(facts[point.identity], conditions)]
        if alike and (tables := make(alike, entry.get("trial"))):
            return tables
    return {}


def _facts(point: FinishedPoint, cases: Mapping[str, str]) -> dict[str, Any]:
    """What entries can give values to."""
    return {**point.config, **point.opening, "case": cases.get(point.identity, "")}


def _meets(facts: Entry, conditions: Entry) -> bool:
    """Whether facts have the values of all conditions, or one of several."""
    return all(
        key in facts
        and any(
            _same(facts[key], value)
            for value in (allowed if isinstance(allowed, list) else [allowed])
        )
        for key, allowed in conditions.items()
    )


def _same(fact: object, value: object) -> bool:
    """Whether two values are equal; a table spells numbers as text."""
    if isinstance(fact, str) and isinstance(value, int | float):
        try:
            return float(fact) == value
        except ValueError:
            return False
    return fact == value


def _ranking(points: Sequence[FinishedPoint], _: object) -> Tables:
    """The tables of one point, with one of its trials."""
    point = points[0]
    probabilities, paths = point.table("probabilities"), point.table("paths")
    phi = probabilities[["hypothesis", "trial", "unconstrained", "constrained"]]
    place = paths.groupby("demonstration", sort=False).cumcount()
    last = ~paths.duplicated("demonstration", keep="last")
    return {
        "example_ranking": _named(point, "hypotheses").merge(phi, on="hypothesis", how="left"),
        "example_paths": _rounded(point, paths[(place % _PATH_EVERY == 0) | last]),
        "example_cells": _cells(point, probabilities["trial"].iloc[:1].tolist()),
        "example_moves": _moves(point),
        "example_regions": point.table("regions"),
        "example_dimensions": point.table("dimensions"),
    }


def _compared(points: Sequence[FinishedPoint], trial: Mapping[str, int] | int | None) -> Tables:
    """One trial in several points; nothing unless the tabular agent can follow it in all."""
    followed = [point.table("trials") for point in points]
    possible = set.intersection(
        *(set(table["trial"][table["feasible"] == "True"].map(int)) for table in followed)
    )
    if isinstance(trial, Mapping):
        trial = trial.get(points[0].opening["truth"])
    if trial is None and possible:
        trial = min(possible)
    if trial not in possible:
        return {}
    shown = [str(trial)]
    violations = [_violations(point, shown) for point in points]
    paths = points[0].table("paths")
    return {
        "compared_cells": pd.concat([_cells(point, shown) for point in points]),
        "compared_violations": pd.concat(violations),
        "compared_paths": _rounded(points[0], paths[paths["demonstration"].isin(shown)]),
    }


def _first(points: Sequence[FinishedPoint], _: object) -> Tables:
    """The ranking by a point's first demonstrations, their paths and what each violates."""
    point = points[0]
    paths = point.table("paths")
    first = sorted(paths["demonstration"].unique(), key=int)[:FIRST]
    violations = _violations(point, first)
    tables = {
        "first_ranking": _named(point, "first"),
        "first_paths": _rounded(point, paths[paths["demonstration"].isin(first)]),
        "first_violations": violations[violations["source"] == "demonstration"].copy(),
    }
    for table in tables.values():
        table.insert(0, "tasks.crossing", point.config["tasks.crossing"])
    return tables


# Of each kind of example: what has one of its own, and what makes its tables.
_MAKERS: dict[str, tuple[tuple[str, ...], Callable[[Sequence[FinishedPoint], Any], Tables]]] = {
    "ranking": (("truth",), _ranking),
    "compared": (("truth",), _compared),
    "first": (("truth", "tasks.crossing"), _first),
}


def _named(point: FinishedPoint, name: str) -> pd.DataFrame:
    """A table of a point, opened by its identity."""
    table = point.table(name)
    table.insert(0, "point", point.identity)
    return table


def _cells(point: FinishedPoint, trials: Sequence[str]) -> pd.DataFrame:
    """The cells that the sampled trajectories of trials visit, with their corners."""
    visits = _named(point, "sampled")
    return visits[visits["trial"].isin(trials)].join(_cell_boxes(point), on="cell")


def _moves(point: FinishedPoint) -> pd.DataFrame:
    """The moves of the cells that the example's trajectory visits, with both cells' corners."""
    boxes = _cell_boxes(point)
    moves = point.table("moves").join(boxes, on="cell")
    return moves.join(boxes.add_prefix("successor_"), on="successor")


def _violations(point: FinishedPoint, trials: Sequence[str]) -> pd.DataFrame:
    """The hypotheses that trials and their sampled trajectories violate, with corners."""
    violations = point.table("violations")
    hypotheses = point.table("hypotheses").set_index("hypothesis")
    corners = hypotheses.filter(regex="^(lower|upper)_").astype(float).round(_CORNER_DECIMALS)
    return violations[violations["trial"].isin(trials)].join(corners, on="hypothesis")


def _cell_boxes(point: FinishedPoint) -> pd.DataFrame:
    """The corners of every cell of a point's grid, by its number."""
    dimensions = point.table("dimensions")
    lower, upper = (dimensions[side].astype(float).to_numpy() for side in ("lower", "upper"))
    grid = point.record["config"]["grid"]
    shape = np.array(grid["shape"])
    widths = (upper - lower) / shape
    first = lower + np.array(grid["offset"] or 0.0) * widths
    place = np.indices(grid["shape"]).reshape(len(shape), -1).T
    corners = np.hstack([first + place * widths, first + (place + 1) * widths])
    names = [f"{side}_{name}" for side in ("lower", "upper") for name in dimensions["name"]]
    numbers = [str(number) for number in range(len(corners))]
    return pd.DataFrame(corners.round(_CORNER_DECIMALS), index=numbers, columns=names)


def _rounded(point: FinishedPoint, paths: pd.DataFrame) -> pd.DataFrame:
    """Paths as exact as they are drawn."""
    values = ["time", *point.table("dimensions")["name"]]
    return paths.assign(**paths[values].astype(float).round(_DECIMALS))


def _below_one_another(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Tables in one; the type of a column is not left to those without rows."""
    return pd.concat([table for table in tables if len(table)] or tables[:1], ignore_index=True)
