"""A point's demonstrations as recorded files, such as somebody else's would be."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.lookback.archive import ArchiveError, Facts
from experiments.tracking.files import read_file
from experiments.tracking.store import Store, Stored
from mlci.demonstrations import Demonstration, Task, even_times
from mlci.recordings.write import write_demonstration
from mlci.spaces import Box, StateSpace

CALIBRATION = "calibration"  # the folder that holds a point's calibration, beside its recordings


def write_recordings(facts: Facts, folder: Path) -> list[Path]:
    """Write a CSV of each demonstration of a finished point, with its goal; no number is rounded.

    If the point's evidence is calibrated, its calibration is written as well: it rests on tasks
    from where the point's tasks come from, which the recordings do not tell.

    Args:
        facts: the point.
        folder: new or empty.

    Returns:
        The files.

    Raises:
        ArchiveError: the point has not finished, its stored demonstrations or its calibration were
            removed, or the folder holds something; or what is stored is not as a point writes it.
    """
    identity = facts.point.identity
    if not facts.record:
        raise ArchiveError(f"{identity}: has not finished; run it first")
    store, stages = Store(facts.point.results / "store"), facts.record["stages"]
    trials = store.read("demonstrations", stages.get("demonstrations", ""))
    if trials is None:
        raise ArchiveError(f"{identity}: its stored demonstrations are gone; run it again")
    if folder.exists() and any(folder.iterdir()):
        raise ArchiveError(f"{folder}: is not empty, and what it holds would be ranked as well")
    try:
        space, demonstrations = _space(facts), _demonstrations(facts, trials)
    except (LookupError, ValueError, TypeError) as error:
        raise ArchiveError(
            f"{identity}: its demonstrations are not as points write them: {error}"
        ) from None
    for stage in ("forecasts", "control_forecasts"):
        key = stages.get(stage)
        if key and not store.copy(stage, key, Store(folder / CALIBRATION)):
            raise ArchiveError(f"{identity}: its stored calibration is gone; run it again")
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"trial_{number:03d}.csv" for number in demonstrations]
    for path, demonstration in zip(files, demonstrations.values(), strict=True):
        write_demonstration(path, demonstration, space)
    return files


def _demonstrations(facts: Facts, trials: Stored) -> dict[int, Demonstration]:
    """The demonstrations of a point by their numbers, from what is stored of all trials."""
    dt, demonstrations = facts.config["demonstrations.dt"], {}
    for number in pd.read_csv(io.BytesIO(read_file(facts.point.folder / "trials.csv")))["trial"]:
        goal = Box(trials["goal_lower"][number], trials["goal_upper"][number])
        task = Task(trials["starts"][number], goal, facts.config["horizon"])
        states, controls = trials["states"][number], trials["controls"][number]
        times = even_times(len(states), dt)
        demonstrations[int(number)] = Demonstration(task, states, controls, times)
    return demonstrations


def _space(facts: Facts) -> StateSpace:
    """The state space of a point."""
    table = io.BytesIO(read_file(facts.point.folder / "dimensions.csv"))
    rows = pd.read_csv(table, keep_default_na=False)
    bounds = Box(np.array(rows["lower"]), np.array(rows["upper"]))
    return StateSpace(bounds, np.array(rows["periodic"]), tuple(rows["name"]), tuple(rows["unit"]))
