"""Tables that all points of a truth share, whatever their grid, time step and actions."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.trials import TrialSet
from mlci.outlines import outline
from mlci.planes import Plane, planes, simplified
from mlci.regions import Regions
from mlci.shapes.shape import Shape
from mlci.spaces import Ints, StateSpace

# Collate keeps one copy of each, opened by these columns alone.
TRUTH_TABLES = {
    "attempts": ("truth", "seed"),
    "dimensions": ("truth",),
    "forecasts": ("cells", "actions", "dt", "samples"),
    "paths": ("truth", "seed"),
    "regions": ("truth",),
    "transfer_values": ("truth",),
}

_OUTLINE = 1e-3  # of the bounds, by which an outline may be off
_PATH_EVERY = 5  # samples of a path between those that its table keeps


def truth_tables(settings: Settings, trials: TrialSet, numbers: Ints) -> dict[str, pd.DataFrame]:
    """The pairs that were tried, the demonstrations' paths, the state space and the truth's boxes.

    Args:
        settings: the point.
        trials: all trials.
        numbers: (N,) those that are demonstrations.
    """
    space = settings.model.space
    samples = trials.states[numbers][:, ::_PATH_EVERY]
    times = np.arange(samples.shape[1]) * _PATH_EVERY * settings.demonstrations.dt
    return {
        "attempts": pd.DataFrame(
            {
                "trial": np.arange(len(trials.outcome)),
                "outcome": trials.outcome,
                "rule_breaking": trials.rule_breaking,
                "cost": trials.cost,
                "goal_distance": trials.miss,
                "peak_control": np.max(np.abs(trials.controls), axis=(1, 2)),
            }
        ),
        "paths": pd.DataFrame(
            {
                "demonstration": np.repeat(numbers, len(times)),
                "time": np.tile(times, len(numbers)),
                **{name: samples[..., d].ravel() for d, name in enumerate(space.names)},
            }
        ),
        "dimensions": dimension_table(space),
        "regions": region_table("region", settings.constraint, planes(settings.candidates)[0]),
    }


def region_table(what: str, regions: Regions, plane: Plane) -> pd.DataFrame:
    """A row a region, numbered in the column `what`: its corners, infinite where it is free.

    Where some region is no box its corners are those of its hull, and the column `outline` has its
    rings in a plane, as JSON.
    """
    names = regions.space.names
    table = pd.DataFrame(
        {
            what: np.arange(len(regions)),
            **{f"lower_{name}": regions.lower[:, k] for k, name in enumerate(names)},
            **{f"upper_{name}": regions.upper[:, k] for k, name in enumerate(names)},
        }
    )
    if not regions.are_boxes.all():
        table["outline"] = [_outline(plane, shape) for shape in regions.shapes]
    return table


def _outline(plane: Plane, shape: Shape | None) -> str:
    """The outline of a region that is no box; nothing of one that is, or of a state of one
    dimension."""
    if shape is None or plane.y is None:
        return ""
    tolerance = _OUTLINE * float(np.min(plane.space.bounds.widths[[plane.x, plane.y]]))
    rings = [simplified(ring, tolerance) for ring in outline(plane, shape)]
    names = [plane.space.names[plane.x], plane.space.names[plane.y]]
    return json.dumps({"dimensions": names, "rings": [np.round(r, 6).tolist() for r in rings]})


def dimension_table(space: StateSpace) -> pd.DataFrame:
    """A row a dimension of the state: what figures need to know of it."""
    return pd.DataFrame(
        {
            "name": space.names,
            "unit": space.units,
            "lower": space.bounds.lower,
            "upper": space.bounds.upper,
            "periodic": space.periodic,
        }
    )
