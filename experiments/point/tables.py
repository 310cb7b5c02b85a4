"""Tables of one point: ranks, ranked hypotheses, and what all points of a truth share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.stages import TrialSet
from experiments.tracking.files import csv_bytes
from mlci.inference import confidence, rank_constraints
from mlci.metrics import random_subsets, top_chances, truth_ranks
from mlci.regions import ConstraintSet
from mlci.spaces import Bools, Floats, Ints, StateSpace

if TYPE_CHECKING:
    pass


# They are the same for all grids, time steps and actions: collate keeps one copy of each, opened
# by these columns alone.
TRUTH_TABLES = {
    "attempts": ("truth", "seed"),
    "dimensions": ("truth",),
    "paths": ("truth", "seed"),
    "regions": ("truth",),
}

PAPER_SIZE = 9  # demonstrations after which the paper looks at the rank
FIRST = 5  # demonstrations of the paper's Fig. 7
BEST = (1, 2)  # so many of the best hypotheses are compared with the truth, as in Fig. 7

_PATH_EVERY = 5  # samples of a path between those that its table keeps


def rank_table(
    settings: Settings, phi: Floats, violated: Bools, reachable: Bools, rng: np.random.Generator
) -> pd.DataFrame:
    """A row a random subset of the demonstrations: where the truth is in the ranking after them.

    Beside the rank of the truth, if there is one, its columns are shares: whether that rank is
    among the first, and whether the best hypothesis, or both of the best two, overlap the truth
    or lie inside it.
    """
    candidates, constraint = settings.candidates, settings.constraint
    truth = candidates.inside(constraint)
    good = {"overlap": candidates.overlaps(constraint), "inside": truth}
    best = [top for top in BEST if top <= len(candidates)] if len(constraint) else []
    wanted = settings.ranks
    rows = []
    for subsets in random_subsets(len(phi), wanted.demonstrations, wanted.subsets, rng):
        rank = truth_ranks(phi, violated, truth, subsets)
        in_top = (rank <= wanted.top).astype(int) if truth.any() else np.nan
        rows.append(
            pd.DataFrame(
                {
                    "demonstrations": subsets.shape[1],
                    "subset": np.arange(len(subsets)),
                    "reachable": np.sum(reachable[subsets], axis=1),
                    "rank": rank,
                    f"share_top_{wanted.top}": in_top,
                    **{
                        f"top_{top}_{name}": top_chances(phi, violated, which, subsets, top)
                        if top in best
                        else np.nan
                        for name, which in good.items()
                        for top in BEST
                    },
                }
            )
        )
    return pd.concat(rows, ignore_index=True)


def ranking_table(
    hypotheses: ConstraintSet, phi: Floats, violated: Bools, prior_none: float
) -> pd.DataFrame:
    """A row a hypothesis: its box, gain, rank and probabilities.

    Args:
        hypotheses: the C hypotheses.
        phi: (N', C) of the demonstrations that the tabular model can follow.
        violated: (N, C) of all demonstrations.
        prior_none: prior probability of no constraint.
    """
    ranking = rank_constraints(phi, violated, prior_none)
    prior = (1 - prior_none) / len(hypotheses)
    certainty = [
        confidence(prior, phi[:, i]) if ranking.feasible[i] else 0.0 for i in range(len(hypotheses))
    ]
    return pd.DataFrame(
        {
            **box_table("hypothesis", hypotheses),
            "feasible": ranking.feasible,
            "violating_demonstrations": np.sum(violated, axis=0),
            "gain": ranking.gain,
            "rank": ranking.rank,
            "posterior": ranking.posterior,
            "confidence_alone": certainty,
        }
    )


def truth_tables(settings: Settings, trials: TrialSet, kept: Ints) -> dict[str, pd.DataFrame]:
    """What all points of a truth share: the pairs that were tried, the paths, the state space."""
    space = settings.model.space
    sampled = trials.states[kept][:, ::_PATH_EVERY]
    times = np.arange(sampled.shape[1]) * _PATH_EVERY * settings.demonstrations.dt
    return {
        "attempts": pd.DataFrame(
            {
                "trial": np.arange(len(trials.outcome)),
                "outcome": trials.outcome,
                "cost": trials.cost,
                "goal_distance": trials.miss,
                "peak_control": np.max(np.abs(trials.controls), axis=(1, 2)),
            }
        ),
        "paths": pd.DataFrame(
            {
                "demonstration": np.repeat(kept, len(times)),
                "time": np.tile(times, len(kept)),
                **{name: sampled[..., d].ravel() for d, name in enumerate(space.names)},
            }
        ),
        "dimensions": dimension_table(space),
        "regions": box_table("region", settings.constraint),
    }


def box_table(what: str, boxes: ConstraintSet) -> pd.DataFrame:
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


def opening_columns(measure: str, settings: Settings) -> dict[str, str | int | float]:
    """The values that open every row of a point's table."""
    columns = settings.columns
    return {name: columns[name] for name in TRUTH_TABLES.get(measure, columns)}


def table_bytes(measure: str, frame: pd.DataFrame, settings: Settings) -> bytes:
    """A point's table as CSV, every row opened by the point's own values, floats exact."""
    columns = opening_columns(measure, settings)
    kept = [name for name in frame.columns if name not in columns]
    opened = frame[kept].copy()
    for place, (name, value) in enumerate(columns.items()):
        opened.insert(place, name, value)
    return csv_bytes(opened)
