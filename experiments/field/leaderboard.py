"""The leaderboard: means with intervals over seeds, and who is best or level with the best."""

from __future__ import annotations

import numpy as np
import pandas as pd
import scipy

from experiments.field.scores import SCORES

OURS = "ours:"  # how names of this project's methods begin


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
    """A row for each world: how our methods stand against the others by one score.

    Columns: `ours`, our method of the best mean; `rival`, the best of the others that are told
    nothing; `scorer`, the best of those that are told how many hypotheses are true; `ahead` and
    `ahead_of_scorer`, the mean of ours less theirs over seeds, signed so that more is better, with
    `lower` and `upper` ends; `verdict`.

    Args:
        runs: rows of `contest`.
        name: the score.
        told: methods that are told how many hypotheses are true.
    """
    sign = 1.0 if SCORES[name][1] else -1.0
    rows = []
    for world, group in runs.groupby("world", sort=False):
        table = sign * group.pivot(index="seed", columns="method", values=name).astype(float)
        ours = [str(method) for method in table if str(method).startswith(OURS)]
        groups = {
            "rival": [str(m) for m in table if m not in ours and m not in told],
            "scorer": [str(m) for m in table if m in told],
        }
        if not ours:
            continue
        best = _best(table, ours)
        row = {"world": world, "ours": best}
        for kind, methods in groups.items():
            if methods:
                other = _best(table, methods)
                gap = interval((table[best] - table[other]).dropna().to_numpy())
                row |= {kind: other, f"ahead_of_{kind}": gap["mean"]}
                row |= {f"lower_{kind}": gap["lower"], f"upper_{kind}": gap["upper"]}
                row[f"verdict_{kind}"] = _verdict(gap)
        rows.append(row)
    return pd.DataFrame(rows)


def _best(table: pd.DataFrame, methods: list[str]) -> str:
    """The method of the largest mean, of equal ones the first."""
    return methods[int(np.argmax([table[method].mean() for method in methods]))]


def _verdict(gap: dict[str, float]) -> str:
    """Who is ahead, if the interval of the difference tells."""
    if gap["mean"] == 0 or not gap["lower"] * gap["upper"] > 0:
        return "level"
    return "ahead" if gap["mean"] > 0 else "behind"
