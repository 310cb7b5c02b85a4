"""Reliability of beliefs over simulated worlds, each weighed by its prior, with intervals."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.collate.intervals import TAILS, resamples
from experiments.config.settings import NO_TRUTH
from experiments.point.belief_counts import EDGES
from mlci.spaces import Floats, Ints

_OF_ROWS = ("source", "demonstrations", "belief")


def reliability(calibration: pd.DataFrame) -> pd.DataFrame:
    """How often beliefs are right, against how probable they are.

    Each set of a world weighs as much as its world's prior, divided by the world's sets. Intervals
    are of a bootstrap with two levels: worlds with a constraint are drawn anew, and in each of them
    its sets; of the world without one, the sets.

    Args:
        calibration: the collated table: opening columns up to `seed`, then those of
            `experiments.point.beliefs.calibration_table`.

    Returns:
        The opening columns but those of the truth and `seed`; `source`, `demonstrations`, `belief`;
        `bin` with its `lower` and `upper` end (infinite for what is no probability); `predicted`,
        the weighted mean probability; `observed`, the weighted share that is right, with `low` and
        `high`; `weight`, the bin's share of all beliefs of the kind; `count`, how many they are.
    """
    names = list(calibration.columns)
    opening = [name for name in names[: names.index("seed")] if not name.startswith("truth")]
    calibration = calibration.assign(world=calibration["truth"].astype(str))
    rows = []
    for key, group in calibration.groupby([*opening, *_OF_ROWS], sort=True, dropna=False):
        group = _weighted(group)
        sets = np.asarray(group.groupby(["world", "seed", "set"]).ngroup(), dtype=np.int64)
        total = np.sum(group["weight"] * group["count"])
        counts = _set_resamples(group, sets, [str(part) for part in key])
        for number in np.unique(group["bin"]):
            inside = (group["bin"] == number).to_numpy()
            of_bin = group[inside]
            weight = of_bin["weight"].to_numpy()
            beliefs = weight * of_bin["count"].to_numpy()
            hits = weight * of_bin["hits"].to_numpy()
            drawn = counts[:, sets[inside]].astype(float)
            with np.errstate(invalid="ignore"):  # a resample may have nothing in a bin
                shares = (drawn @ hits) / (drawn @ beliefs)
            low, high = np.nanquantile(shares, TAILS)
            edges = (-np.inf, *EDGES, np.inf)
            rows.append(
                {
                    **dict(zip([*opening, *_OF_ROWS], key, strict=True)),
                    "bin": number,
                    "lower": edges[number],
                    "upper": edges[number + 1],
                    "predicted": np.sum(weight * of_bin["predicted"]) / np.sum(beliefs),
                    "observed": np.sum(hits) / np.sum(beliefs),
                    "low": low,
                    "high": high,
                    "weight": np.sum(beliefs) / total,
                    "count": int(of_bin["count"].sum()),
                }
            )
    return pd.DataFrame(rows)


def _weighted(group: pd.DataFrame) -> pd.DataFrame:
    """The rows with the weight of a set of theirs."""
    drawn = group.drop_duplicates(["world", "seed"]).groupby("world")["sets"].sum()
    return group.assign(weight=group["prior"] / group["world"].map(drawn))


def _set_resamples(group: pd.DataFrame, sets: Ints, key: list[str]) -> Floats:
    """(B, N) how often each of N sets is drawn."""
    of_set = group.assign(number=sets).drop_duplicates("number").sort_values("number")
    nothing = (of_set["world"] == NO_TRUTH).to_numpy()
    counts = np.zeros((0, len(of_set)))
    for part, worlds in ((nothing, of_set["number"]), (~nothing, of_set["world"])):
        if part.any():
            _, sizes = np.unique(worlds[part], return_counts=True)
            found = resamples(sizes, [*key, str(bool(part[0]))])
            counts = counts if len(counts) else np.zeros((len(found), len(of_set)))
            counts[:, part] = found
    return counts
