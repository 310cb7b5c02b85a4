"""Reliability of beliefs over simulated worlds, each weighed by its prior, with intervals."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.collate.finished import LAST_OPENING
from experiments.collate.intervals import RESAMPLES, TAILS, Floats, Ints, resamples

# As in the points' tables: the ends of the bins of probability, and the truth that forbids nothing.
EDGES = (0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
NO_TRUTH = "none"

_OF_ROWS = ("source", "demonstrations", "belief")


def reliability(calibration: pd.DataFrame) -> pd.DataFrame:
    """How often beliefs are right, against how probable they are.

    Each set of a world weighs as much as its world's prior, divided by the world's sets. Intervals
    are of a bootstrap with two levels: worlds with a constraint are drawn anew, and in each of them
    its sets; of the world without one, the sets.

    Args:
        calibration: the collated table: opening columns up to `seed`, then `source`, `prior` of the
            world, `sets` that were drawn, `set`, `demonstrations`, `belief`, `bin`, and of the
            beliefs in that bin their `count`, the sum of their probabilities (`predicted`), and how
            many were right (`hits`).

    Returns:
        The opening columns but those of the truth and `seed`; `source`, `demonstrations`, `belief`;
        `bin` with its `lower` and `upper` end (infinite for what is no probability); `predicted`,
        the weighted mean probability; `observed`, the weighted share that is right, with `low` and
        `high`; `weight`, the bin's share of all beliefs of the kind; `count`, how many they are.
    """
    names = list(calibration.columns)
    opening = [name for name in names[: names.index(LAST_OPENING)] if not name.startswith("truth")]
    calibration = calibration.assign(world=calibration["truth"].astype(str))
    rows = []
    for key, group in calibration.groupby([*opening, *_OF_ROWS], sort=True, dropna=False):
        group = weighted(group)
        sets = np.asarray(group.groupby(["world", LAST_OPENING, "set"]).ngroup(), dtype=np.int64)
        counts = set_resamples(group, sets, [str(part) for part in key])
        total = np.sum(group["weight"] * group["count"])
        for number in np.unique(group["bin"]):
            inside = (group["bin"] == number).to_numpy()
            bin_row = _bin_row(int(number), group[inside], counts[:, sets[inside]], total)
            rows.append({**dict(zip([*opening, *_OF_ROWS], key, strict=True)), **bin_row})
    return pd.DataFrame(rows)


def _bin_row(number: int, rows: pd.DataFrame, counts: Floats, total: float) -> dict[str, float]:
    """What a table of reliability says of one bin.

    Args:
        number: the bin.
        rows: the rows of the bin, each with the weight of its set.
        counts: (B, rows) how often each row's set is in each resample.
        total: the weight of all beliefs, whatever their bin.
    """
    weight = rows["weight"].to_numpy()
    beliefs, hits = weight * rows["count"].to_numpy(), weight * rows["hits"].to_numpy()
    with np.errstate(invalid="ignore"):  # a resample may have nothing in a bin
        shares = (counts @ hits) / (counts @ beliefs)
    low, high = np.nanquantile(shares, TAILS)
    edges = (-np.inf, *EDGES, np.inf)
    return {
        "bin": number,
        "lower": edges[number],
        "upper": edges[number + 1],
        "predicted": np.sum(weight * rows["predicted"]) / np.sum(beliefs),
        "observed": np.sum(hits) / np.sum(beliefs),
        "low": low,
        "high": high,
        "weight": np.sum(beliefs) / total,
        "count": int(rows["count"].sum()),
    }


def weighted(group: pd.DataFrame) -> pd.DataFrame:
    """The rows, each with the `weight` of its set: its world's prior by the world's sets."""
    of_seed = group.drop_duplicates(["world", LAST_OPENING])
    sets = of_seed.groupby("world")["sets"].sum()
    return group.assign(weight=group["prior"] / group["world"].map(sets))


def set_resamples(group: pd.DataFrame, sets: Ints, key: list[str]) -> Floats:
    """(B, N) how often each of N sets is in each resample."""
    of_set = group.assign(number=sets).drop_duplicates("number").sort_values("number")
    without = (of_set["world"] == NO_TRUTH).to_numpy()
    counts = np.zeros((RESAMPLES, len(of_set)))
    for part, worlds in ((without, of_set["number"]), (~without, of_set["world"])):
        if part.any():
            _, sizes = np.unique(worlds[part], return_counts=True)
            counts[:, part] = resamples(sizes, [*key, str(bool(part[0]))])
    return counts
