"""The leaderboard: means with intervals over seeds, and who is best or level with the best."""

from __future__ import annotations

import numpy as np
import pandas as pd
import scipy

from experiments.field.scores import SCORES

# The method of ours that stands for all, by what it is told; both were settled by practice.
OURS = {"untold": "ours: sets", "told": "ours: ranked"}


def leaderboard(runs: pd.DataFrame) -> pd.DataFrame:
    """A row for each world, method and score: `mean`, `lower`, `upper`, `seeds`.

    The interval is Student's, of 95 %, over seeds; nan with one seed.
    """
    rows = []
    for (world, method), group in runs.groupby(["world", "method"], sort=False):
        for name in SCORES:
            values = group[name].astype(float).dropna().to_numpy()
            rows.append({"world": world, "method": method, "score": name, **interval(values)})
    return pd.DataFrame(rows)


def interval(values: np.ndarray) -> dict[str, float]:
    """Mean and 95 % interval of some values (n,)."""
    count = len(values)
    mean = float(np.mean(values)) if count else np.nan
    half = np.nan
    if count > 1:
        half = float(scipy.special.stdtrit(count - 1, 0.975) * np.std(values, ddof=1) / count**0.5)
    return {"mean": mean, "lower": mean - half, "upper": mean + half, "seeds": count}


def standings(runs: pd.DataFrame, name: str, told: set[str]) -> pd.DataFrame:
    """A row for each world and kind of knowledge: how our method stands against the best other.

    Columns: `world`; `kind`, `untold` or `told`; `ours` and `other`, the two methods; `ahead`, the
    mean of ours less the other's over seeds, signed so that more is better, with `lower` and
    `upper` ends; `verdict`. The best other one is picked in each world by these runs, ours is not.

    Args:
        runs: rows of `contest`.
        name: the score.
        told: methods that are told how many hypotheses are true.
    """
    sign = 1.0 if SCORES[name][1] else -1.0
    rows = []
    for world, group in runs.groupby("world", sort=False):
        table = sign * group.pivot(index="seed", columns="method", values=name).astype(float)
        for kind, ours in OURS.items():
            others = [
                str(method)
                for method in table
                if not str(method).startswith("ours:") and (method in told) == (kind == "told")
            ]
            if ours not in table or not others:
                continue
            other = _best(table, others)
            gap = interval((table[ours] - table[other]).dropna().to_numpy())
            row = {"world": world, "kind": kind, "ours": ours, "other": other}
            row |= {"ahead": gap["mean"], "lower": gap["lower"], "upper": gap["upper"]}
            rows.append(row | {"verdict": _verdict(gap)})
    return pd.DataFrame(rows)


def _best(table: pd.DataFrame, methods: list[str]) -> str:
    """The method of the largest mean, of equal ones the first."""
    return methods[int(np.argmax([table[method].mean() for method in methods]))]


def _verdict(gap: dict[str, float]) -> str:
    """Who is ahead, if the interval of the difference tells; one seed has none."""
    if gap["seeds"] < 2:
        return "unknown"
    if gap["mean"] == 0 or not gap["lower"] * gap["upper"] > 0:
        return "level"
    return "ahead" if gap["mean"] > 0 else "behind"
