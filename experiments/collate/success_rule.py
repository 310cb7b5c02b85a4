"""Which numbers known before inference foretell its success: a rule, judged on systems left out."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.collate.intervals import TAILS, Floats, resamples
from mlci.outlook.outlook import FEATURES
from mlci.outlook.rule import (
    brier_scores,
    choose_features,
    fit_rule,
    left_out,
    left_out_choice,
)

MOST = 3  # features of the rule
ALONE = "expected_violations"  # what the rule is compared with, beside the base rate
# The rule takes the share of simulated studies that succeed in any case, and other numbers where
# they pay on systems left out: choices from nothing and from expected violations were no better
# than expected violations alone.
FIRST = (FEATURES.index("simulated"),)
_MEANS = ("top", "first", "log_rank", "claim", "over_claim", "violation_distance", "out_of_reach")


def success_tables(dynamics: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The tables that are made of `dynamics`, by name.

    Returns:
        `success_systems`, means of each system, number of cells and time step. With points of
        two systems or more also `success_rule`, a row a feature; `success_scores`, a row a way to
        foretell; and `success_forecasts`, a row a point with what each way says of it.
    """
    made = {"success_systems": success_systems(dynamics)}
    told = dynamics.dropna(subset=[*FEATURES, "top"]).reset_index(drop=True)
    if told["system"].nunique() >= 2:  # one that is left out
        forecasts = success_forecasts(told)
        made["success_forecasts"] = forecasts
        made["success_scores"] = success_scores(forecasts)
        made["success_rule"] = success_rule(told)
    return made


def success_systems(dynamics: pd.DataFrame) -> pd.DataFrame:
    """Means over the truths and seeds of a system, number of cells and time step.

    Args:
        dynamics: the collated table; `over_claim` is `claim` less `first`.

    Returns:
        `system`, `cells`, `dt`, `samples`; number of `points`; each measure with `_low` and
        `_high`, 95 % bootstrap intervals over points.
    """
    table = dynamics.assign(over_claim=dynamics["claim"] - dynamics["first"])
    rows = []
    for key, group in table.groupby(["system", "cells", "dt", "samples"], sort=True):
        names = dict(zip(("system", "cells", "dt", "samples"), key, strict=True))
        counts = resamples(np.ones(len(group), dtype=np.int64), [*map(str, key), "dynamics"])
        row = {**names, "points": len(group)}
        for name in _MEANS:
            row |= _interval(name, group[name].to_numpy(float), counts.astype(float))
        rows.append(row)
    return pd.DataFrame(rows)


def success_forecasts(told: pd.DataFrame) -> pd.DataFrame:
    """What each way foretells of each point from points of other systems alone.

    Returns:
        `system`, `cells`, `dt`, `truth`, `seed`; `top`, the success; and `rule`,
        `expected_violations`, `all_features` and `base_rate`, each the probability of success.
    """
    features, success = told[list(FEATURES)].to_numpy(float), told["top"].to_numpy(float)
    systems = told["system"].to_numpy()
    alone = features[:, [FEATURES.index(ALONE)]]
    return told[["system", "cells", "dt", "truth", "seed", "top"]].assign(
        rule=left_out_choice(features, success, systems, MOST, FIRST),
        expected_violations=left_out(alone, success, systems),
        all_features=left_out(features, success, systems),
        base_rate=left_out(features[:, []], success, systems),
    )


def success_scores(forecasts: pd.DataFrame) -> pd.DataFrame:
    """Brier scores of each way to foretell, and how much the rule's is less.

    Returns:
        `way`; `brier`, and `rule_less`, the rule's score less it, each with `_low` and `_high`, by
        a bootstrap over systems and, in each, points; numbers of `systems` and `points`.
    """
    ordered = forecasts.sort_values("system", kind="stable")
    sizes = np.unique(ordered["system"].to_numpy(str), return_counts=True)[1].astype(np.int64)
    counts = resamples(sizes, ["success_scores"]).astype(float)
    success = ordered["top"].to_numpy(float)
    scores = {
        way: brier_scores(ordered[way].to_numpy(float), success)
        for way in ("rule", "expected_violations", "all_features", "base_rate")
    }
    return pd.DataFrame(
        [
            {
                "way": way,
                "systems": len(sizes),
                "points": len(ordered),
                **_interval("brier", score, counts),
                **_interval("rule_less", scores["rule"] - score, counts),
            }
            for way, score in scores.items()
        ]
    )


def success_rule(told: pd.DataFrame) -> pd.DataFrame:
    """The rule that all points make, the most telling feature first.

    Returns:
        `feature`, `intercept` for the last; `mean` and `scale` of it; `weight`, log odds of success
        a scale, with `weight_low` and `weight_high` by a bootstrap over systems; the `least` and
        the `most` that the study has of it.
    """
    features, success = told[list(FEATURES)].to_numpy(float), told["top"].to_numpy(float)
    systems = told["system"].to_numpy()
    chosen = choose_features(features, success, systems, MOST, FIRST)
    of_chosen = features[:, chosen]
    rule = fit_rule(of_chosen, success)
    names = np.unique(systems)
    rng, again = np.random.default_rng(0), []
    for _ in range(200):
        rows = np.concatenate(
            [np.flatnonzero(systems == name) for name in rng.choice(names, len(names))]
        )
        other = fit_rule(of_chosen[rows], success[rows])
        weights = other.weights * rule.scale / other.scale
        at_mean = other.intercept + np.sum((rule.mean - other.mean) / other.scale * other.weights)
        again.append([*weights, at_mean])
    low, high = np.quantile(again, TAILS, axis=0)
    return pd.DataFrame(
        {
            "feature": [*(FEATURES[number] for number in chosen), "intercept"],
            "mean": [*rule.mean, 0.0],
            "scale": [*rule.scale, 1.0],
            "weight": [*rule.weights, rule.intercept],
            "weight_low": low,
            "weight_high": high,
            "least": [*of_chosen.min(axis=0), np.nan],
            "most": [*of_chosen.max(axis=0), np.nan],
        }
    )


def _interval(name: str, values: Floats, counts: Floats) -> dict[str, float]:
    """The mean of values that are there (B,), with limits over resamples (R, B) of counts."""
    there = ~np.isnan(values)
    if not there.any():
        return {name: np.nan, f"{name}_low": np.nan, f"{name}_high": np.nan}
    counts, values = counts[:, there], values[there]
    total = counts.sum(axis=1)
    means = (counts @ values)[total > 0] / total[total > 0]
    low, high = np.quantile(means, TAILS)
    return {name: float(np.mean(values)), f"{name}_low": low, f"{name}_high": high}
