"""Finished points that are written by hand: a record and small tables, nothing computed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.tracking.files import csv_bytes, digest, replace_file
from experiments.tracking.points import Point
from experiments.tracking.sealed import read_sealed, write_sealed

CONFIG: dict[str, Any] = {
    "system": {"target": "mlci.systems.DoubleIntegrator", "arguments": {}},
    "truth": {"name": "wall"},
    "grid": {"shape": [4, 3], "offset": None, "refined": 0},
    "actions": 3,
    "dt": 0.5,
    "transition": {"samples": 1},
    "temperature": 1.0,
    "tasks": {"crossing": False},
    "seed": 0,
}
# Of the truth alone: one of these stands for all grids, time steps and actions.
OPENING_OF_TRUTH = {"attempts": ("truth", "seed"), "paths": ("truth", "seed")}
OPENING_OF_TRUTH |= {"dimensions": ("truth",), "regions": ("truth",)}


def hand_made(
    results: Path,
    tables: Mapping[str, pd.DataFrame] | None = None,
    record: Mapping[str, Any] | None = None,
    **values: Any,
) -> Point:
    """A finished point.

    Args:
        results: the folder of all results.
        tables: without the columns that open them; a summary of one row is there anyway.
        record: what its record has of its own.
        values: of the config; two underscores stand for a dot.
    """
    config = deepcopy(CONFIG)
    for key, value in values.items():
        *path, last = key.split("__")
        part = config
        for name in path:
            part = part[name]
        part[last] = value
    point = Point.planned(config, results)
    tables = {"summary": pd.DataFrame({"demonstrations": [3]}), **(tables or {})}
    files = {"log.txt": digest(b"")}
    replace_file(point.folder / "log.txt", b"")
    for name, table in tables.items():
        data = csv_bytes(opened(name, table, config))
        replace_file(point.folder / f"{name}.csv", data)
        files[f"{name}.csv"] = digest(data)
    content = {
        "identity": point.identity,
        "source": point.source,
        "config": config,
        "files": files,
        "stages": {},
        "started": "2026-01-01T00:00:00.000+00:00",
        "seconds": {"total": 1.0},
        "git": {"commit": "c0ffee", "dirty": False, "diff": None},
        "python": "3.12",
        "packages": {"numpy": "2.0"},
        "peak_memory_mb": 1,
        **{"cpu": "abacus", "cores": 1, "system": "Linux"},
        **(record or {}),
    }
    point.write_note("record", content)
    return point


def alter(path: Path, **changes: Any) -> None:
    """Change what a file that carries its own digest says, as if it had been written so."""
    write_sealed(path, {**read_sealed(path), **changes})


def opened(name: str, table: pd.DataFrame, config: Mapping[str, Any]) -> pd.DataFrame:
    """A table with the columns that open it."""
    columns = {
        "truth": config["truth"]["name"],
        "cells": math.prod(config["grid"]["shape"]),
        "actions": config["actions"],
        "dt": config["dt"],
        "samples": config["transition"]["samples"],
        "seed": config["seed"],
    }
    kept = OPENING_OF_TRUTH.get(name, tuple(columns))
    front = {column: columns[column] for column in kept}
    return pd.DataFrame({**front, **table}, index=table.index)
