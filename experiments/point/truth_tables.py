"""Tables that all points of a truth share, whatever their grid, time step and actions."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.trials import TrialSet
from mlci.regions import Regions
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
        "regions": box_table("region", settings.constraint),
    }


def box_table(what: str, boxes: Regions) -> pd.DataFrame:
    """A row a box, numbered in the column `what`: its corners, infinite where it is free."""
    names = boxes.space.names
    return pd.DataFrame(
        {
            what: np.arange(len(boxes)),
            **{f"lower_{name}": boxes.lower[:, k] for k, name in enumerate(names)},
            **{f"upper_{name}": boxes.upper[:, k] for k, name in enumerate(names)},
        }
    )


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
