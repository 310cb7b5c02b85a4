"""A world from recordings that lie in a folder of the user's: paths in a plane, as CSV files.

The folder holds one CSV a path, with columns `time`, `x` and `y`, and `world.yaml`:

    lower: [0, 0]          # corners of the plane [m]
    upper: [1, 1]
    forbidden:             # what nobody may enter, if it is known: boxes or ellipses
      - {center: [0.5, 0.5], radii: [0.1, 0.1]}
      - {lower: [0.1, 0.1], upper: [0.2, 0.3]}
    speed: 1.0             # [m/s] that people reach along each axis
    dt: 0.2                # [s], a step of the table
    temperature: 0.02
    source: where it is from
"""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from experiments.field.entries import Case, EntryError, World
from experiments.field.worlds.continuous import Cells, box
from experiments.tracking.files import read_file
from mlci.demonstrations import Demonstration
from mlci.recordings.read import read_demonstrations
from mlci.regions import Regions
from mlci.shapes.balls import Ball
from mlci.spaces import StateSpace
from mlci.systems import FunctionSystem

_SETTINGS = {"lower", "upper", "forbidden", "speed", "dt", "temperature", "source"}


def world(folder: Path) -> World:
    """The world of a folder of recordings.

    Raises:
        ValueError: no `world.yaml`, or one that lacks an entry.
    """
    settings = _settings(folder)
    return World(
        make=partial(make, folder),
        demonstrations=20,
        source=str(settings["source"]),
        setting=f"a point in a plane that moves as it is told, temperature "
        f"{settings['temperature']}, reward minus the squared speed, no discount; hard: no state "
        f"inside; 20 x 20 cells, 49 actions, {settings['dt']} s, 100 hypotheses",
        differs="a seed shows some of the recordings, drawn without replacement",
    )


def make(folder: Path, seed: int, count: int) -> Case:
    """Some of the recordings, drawn at random.

    Raises:
        ValueError: no readable recordings.
    """
    cells, paths = _recorded(folder)
    rng = np.random.default_rng(seed)
    some = rng.permutation(len(paths))[:count]
    return cells.case([paths[k] for k in some], 0)


@cache
def _recorded(folder: Path) -> tuple[Cells, list[Demonstration]]:
    """The table and all recordings."""
    settings = _settings(folder)
    system, truth = _plane(settings)
    paths, problems, _ = read_demonstrations(folder, system)
    if not paths:
        raise EntryError(f"{folder} has no readable recordings: {'; '.join(map(str, problems))}")
    times = float(settings["dt"]), float(settings["temperature"])
    return Cells(system, truth, (20, 20), 7, times[0], (10, 10), times[1]), paths


def _plane(settings: dict[str, Any]) -> tuple[FunctionSystem, Regions]:
    """The system and the truth.

    Raises:
        ValueError, TypeError, KeyError: an entry that describes none.
    """
    space = StateSpace(
        box(settings["lower"], settings["upper"]), np.zeros(2, dtype=bool), ("x", "y"), ("m", "m")
    )
    limit = np.full(2, float(settings["speed"]))
    system = FunctionSystem(lambda x, u: (u[..., 0], u[..., 1]), space, box(-limit, limit))
    shapes = [
        Ball(each["center"], each["radii"])
        if "center" in each
        else box(each["lower"], each["upper"])
        for each in settings["forbidden"]
    ]
    return system, Regions.from_shapes(space, shapes)


def _settings(folder: Path) -> dict[str, Any]:
    """What `world.yaml` says."""
    path = folder / "world.yaml"
    try:
        settings = yaml.safe_load(read_file(path))
    except (OSError, yaml.YAMLError) as error:
        raise ValueError(f"{path} cannot be read: {error}") from None
    if not isinstance(settings, dict) or settings.keys() != _SETTINGS:
        raise ValueError(f"{path} needs the entries {', '.join(sorted(_SETTINGS))}, and no others")
    for name in ("speed", "dt", "temperature"):
        number = settings[name]
        if not isinstance(number, int | float) or not 0 < number < np.inf:
            raise ValueError(f"{path}: {name} must be a number above 0, not {number!r}")
    try:
        _plane(settings)
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(
            f"{path}: lower and upper are two corners, and forbidden is a list of "
            "{center, radii} or {lower, upper}: " + f"{type(error).__name__}: {error}"
        ) from error
    return settings
