"""How many demonstrations are needed if tasks are chosen, against random ones, with intervals.

Who has not found the truth when its demonstrations end is censored there, not left out: shares are
Kaplan and Meier's, and a median that is never met is infinite. Points have demonstrations of their
own and each repetition its pool, so that the bootstrap has two levels: it draws points anew, and in
each of them repetitions, always with both ways to pick tasks.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from experiments.collate.finished import LAST_OPENING
from experiments.collate.intervals import TAILS, Floats, resamples

ALL = "all"  # the truth of rows over all truths together
WAYS = ("chosen", "random")
EVENTS = ("sure", "settled")  # what is counted until; see the points' table
EARLY = (
    "best_overlaps",
    "two_overlap",
    "area_overlaps",
    "likeliest_overlaps",
    "likeliest_precision",
    "likeliest_share",
)


def chosen_tasks(next_task: pd.DataFrame) -> pd.DataFrame:
    """How many demonstrations it takes to find the truth, a row a truth, source and event.

    Args:
        next_task: the collated table of that name: opening columns up to `seed`, then `source`,
            `repetition`, `way`, `tried`, `sure`, `settled` and the columns of `EARLY`.

    Returns:
        The opening columns but `seed`, `truth` being `all` for all truths together; `source`;
        `until`, what is counted until; how many `points` and `repetitions`; `longest`, the number
        of demonstrations after which a repetition ends; for either way its `<way>_median`,
        infinite if fewer than half are done by then, `<way>_mean`, counting no more than `longest`,
        and `<way>_share`, how many are done at all; `median_ratio` and `mean_ratio` of chosen over
        random, the former an upper bound where random tasks meet no median, and missing where
        neither do. Each with `_low` and `_high`.
    """
    rows = []
    for opening, group in _groups(next_task):
        counts = _resampled(group, list(map(str, opening.values())))
        for until in EVENTS:
            longest, values = int(group["tried"].max()), dict[str, Floats]()
            for way in WAYS:
                curve = _curve(group[group["way"] == way], until, counts, longest)
                values[f"{way}_median"] = _medians(curve)
                values[f"{way}_mean"] = np.sum(curve[:, :-1], axis=1)
                values[f"{way}_share"] = 1 - curve[:, -1]
            values["median_ratio"] = _ratio(
                values["chosen_median"], values["random_median"], longest
            )
            values["mean_ratio"] = values["chosen_mean"] / values["random_mean"]
            sizes = {"points": group.groupby(["truth", LAST_OPENING]).ngroups}
            sizes |= {"repetitions": counts.shape[1], "longest": longest}
            rows.append({**opening, "until": until, **sizes, **_with_limits(values)})
    return pd.DataFrame(rows)


def unfound(next_task: pd.DataFrame) -> pd.DataFrame:
    """The share that has not found the truth after so many demonstrations.

    Args:
        next_task: as of `chosen_tasks`.

    Returns:
        The opening columns of `chosen_tasks`, `source`, `until`, `way`, `demonstrations` from 0 on,
        and `share` with `share_low` and `share_high`.
    """
    rows = []
    for opening, group in _groups(next_task):
        counts = _resampled(group, list(map(str, opening.values())))
        for until in EVENTS:
            for way in WAYS:
                picked = group[group["way"] == way]
                curve = _curve(picked, until, counts, int(group["tried"].max()))
                low, high = np.quantile(curve[1:], TAILS, axis=0)
                columns = {"share": curve[0], "share_low": low, "share_high": high}
                numbers = {"demonstrations": np.arange(curve.shape[1])}
                rows.append(
                    pd.DataFrame({**opening, "until": until, "way": way, **numbers, **columns})
                )
    return pd.concat(rows, ignore_index=True) if rows else pd.DataFrame()


def early_overlap(next_task: pd.DataFrame) -> pd.DataFrame:
    """How often the answer after five demonstrations overlaps the truth.

    Args:
        next_task: as of `chosen_tasks`.

    Returns:
        The opening columns of `chosen_tasks`, `source`, `way`, and the share of each column of
        `EARLY` with `_low` and `_high`.
    """
    rows = []
    for opening, group in _groups(next_task):
        counts = _resampled(group, list(map(str, opening.values())))
        weights = np.vstack([np.ones(counts.shape[1]), counts])
        for way in WAYS:
            picked = group[group["way"] == way][list(EARLY)].to_numpy(dtype=float)
            there = ~np.isnan(picked)
            with np.errstate(invalid="ignore"):
                shares = (weights @ np.nan_to_num(picked)) / (weights @ there.astype(float))
            values = dict(zip(EARLY, shares.T, strict=True))
            rows.append({**opening, "way": way, **_with_limits(values)})
    return pd.DataFrame(rows)


def _groups(next_task: pd.DataFrame) -> Iterator[tuple[dict[str, object], pd.DataFrame]]:
    """Each truth and source, then all truths of a source, with rows in one order for both ways."""
    names = list(next_task.columns)
    opening = [*names[: names.index(LAST_OPENING)], "source"]
    order = ["truth", LAST_OPENING, "repetition"]
    table = next_task.assign(truth=next_task["truth"].astype(str)).sort_values(order, kind="stable")
    several = table["truth"].nunique() > 1
    together = [name for name in opening if name != "truth"]
    for keys in (opening, together)[: 1 + several]:
        for key, group in table.groupby(keys, sort=True, dropna=False):
            values = {"truth": ALL, **dict(zip(keys, key, strict=True))}
            yield {name: values[name] for name in opening}, group


def _resampled(group: pd.DataFrame, key: list[str]) -> Floats:
    """(B, R) how often each repetition, in its order, counts in each resample."""
    repetitions = group[group["way"] == WAYS[0]]
    sizes = np.asarray(repetitions.groupby(["truth", LAST_OPENING]).size(), dtype=np.int64)
    return resamples(sizes, key).astype(float)


def _curve(rows: pd.DataFrame, until: str, counts: Floats, longest: int) -> Floats:
    """(1 + B, longest + 1) share not done after 0, 1, ... demonstrations, of all and of resamples.

    Kaplan and Meier: the product of 1 - done at n / still there at n.
    """
    weights = np.vstack([np.ones(counts.shape[1]), counts])
    event = rows[until].to_numpy(dtype=float)
    last = np.where(np.isnan(event), rows["tried"].to_numpy(dtype=float), event)
    numbers = np.arange(longest + 1)
    done = weights @ (event[:, None] == numbers)
    there = weights @ (last[:, None] >= numbers)
    return np.cumprod(1 - done / np.maximum(there, 1), axis=1)


def _medians(curve: Floats) -> Floats:
    """(1 + B,) the first number of demonstrations after which no more than half are left."""
    half = curve <= 0.5 + 1e-9
    return np.where(half.any(axis=1), np.argmax(half, axis=1), np.inf)


def _ratio(chosen: Floats, random: Floats, longest: int) -> Floats:
    """Ratio (1 + B,) of medians; at most so much where that of random tasks is beyond `longest`."""
    neither = np.isinf(chosen) & np.isinf(random)
    return np.where(neither, np.nan, chosen / np.minimum(random, longest + 1))


def _with_limits(values: dict[str, Floats]) -> dict[str, float]:
    """Values over all (first) with the ends of their intervals over resamples; NaN is none."""
    row: dict[str, float] = {}
    for name, drawn in values.items():
        there = drawn[1:][~np.isnan(drawn[1:])]
        low, high = (
            np.quantile(there, TAILS, method="inverted_cdf") if len(there) else (np.nan, np.nan)
        )
        row |= {name: drawn[0], f"{name}_low": low, f"{name}_high": high}
    return row
