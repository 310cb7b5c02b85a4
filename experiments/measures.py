"""Tables of one point: ranks, ranked hypotheses, and what all points of a truth share."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.settings import Settings
from experiments.stages import TrialSet
from mlci.constraints import ConstraintSet
from mlci.inference import confidence, rank_constraints
from mlci.metrics import random_subsets, truth_ranks
from mlci.spaces import Bools, Floats, Ints, StateSpace

# They depend on the truth alone, open with its name only, and collate keeps one copy of each.
TRUTH_TABLES = ("attempts", "dimensions", "paths")

_PATH_EVERY = 5  # samples of a path between those that its table keeps


def rank_tables(
    settings: Settings, phi: Floats, violated: Bools, reachable: Bools, rng: np.random.Generator
) -> dict[str, pd.DataFrame]:
    """Rank of the truth over random subsets of the demonstrations, and its quantiles."""
    truth = settings.candidates.inside(settings.constraint)
    wanted = settings.ranks
    rows = []
    for subsets in random_subsets(len(phi), wanted.demonstrations, wanted.subsets, rng):
        rows.append(
            pd.DataFrame(
                {
                    "demonstrations": subsets.shape[1],
                    "subset": np.arange(len(subsets)),
                    "reachable": np.sum(reachable[subsets], axis=1),
                    "rank": truth_ranks(phi, violated, truth, subsets),
                }
            )
        )
    ranks = pd.concat(rows, ignore_index=True)
    by_size = ranks.groupby("demonstrations")["rank"]
    quantiles = pd.DataFrame(
        {
            "q10": by_size.quantile(0.10),
            "q25": by_size.quantile(0.25),
            "median": by_size.median(),
            "q75": by_size.quantile(0.75),
            "q90": by_size.quantile(0.90),
            f"share_top_{wanted.top}": (ranks["rank"] <= wanted.top)
            .groupby(ranks["demonstrations"])
            .mean(),
        }
    ).reset_index()
    return {"ranks": ranks, "rank_quantiles": quantiles}


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
            "hypothesis": np.arange(len(hypotheses)),
            **{f"lower_{d}": hypotheses.lower[:, k] for k, d in enumerate(hypotheses.space.names)},
            **{f"upper_{d}": hypotheses.upper[:, k] for k, d in enumerate(hypotheses.space.names)},
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
    }


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
