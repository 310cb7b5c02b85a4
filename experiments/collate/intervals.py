"""Tables of a whole study: measures and rank curves over its seeds, with bootstrap intervals.

A group is all points that differ in their seed alone. Each seed has demonstrations of its own, so
its rows resemble each other, and the bootstrap has two levels: a resample draws as many seeds as
the group has, with replacement, and from each drawn seed as many of its rows as it has, with
replacement (demonstrations for `measures`, random subsets of them for `rank_curve`). A statistic is
taken over all rows of a resample together; `low` and `high` are its 2.5 % and 97.5 % quantiles over
1000 resamples, the percentile method. A row without a value, such as the final-state error of a
demonstration that is infeasible in the tabular model, is drawn like any other and left out of the
statistic.

With one seed an interval holds the second level alone; in `rank_curve` this is no more than the
choice of the subsets, and tells nothing of other demonstrations. With S seeds the variance between
them comes out too small by (S - 1) / S. The pooled violation distance is the mean of what each
demonstration adds to it, and is resampled as such a mean.

Every group of `measures`, and every number of demonstrations of a group in `rank_curve`, has a
random stream of its own, derived from its key, and orders what it draws from: none depends on
another, nor on the order of the points' rows.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from warnings import catch_warnings, simplefilter

import numpy as np
import numpy.typing as npt
import pandas as pd

from experiments.collate.finished import LAST_OPENING

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

RESAMPLES = 1000
_DRAWS_AT_ONCE = 1 << 16  # that stay in the cache
TAILS = (0.025, 0.975)  # of a 95 % interval


def study_tables(tables: Mapping[str, Path]) -> dict[str, pd.DataFrame]:
    """The tables of a whole study, from those of its points.

    Args:
        tables: the collated tables by name: `trials` makes `measures`, `ranks` makes `rank_curve`,
            and `areas`, `control_ranks` and `joint_ranks`, where they are, `area_curve`,
            `control_curve` and `joint_curve`.
    """
    makers = {
        "measures": ("trials", measures),
        "rank_curve": ("ranks", rank_curve),
        "area_curve": ("areas", area_curve),
        "control_curve": ("control_ranks", control_curve),
        "joint_curve": ("joint_ranks", joint_curve),
    }
    return {
        name: make(_read(tables[source]))
        for name, (source, make) in makers.items()
        if source in tables
    }


def measures(trials: pd.DataFrame) -> pd.DataFrame:
    """The mean of each column of `trials` over the demonstrations of a group, with its interval.

    Args:
        trials: opening columns up to `seed`, `trial`, and a column a measure; NaN is no value.

    Returns:
        The opening columns but `seed`; `measure`; `mean`, `low`, `high`; how many `seeds`, and how
        many `demonstrations` have a value.
    """
    rows = []
    for opening, group in _groups(trials, ["trial"]):
        seeds, names = _sizes(group), _columns_after(group, "trial")
        values = group[names].to_numpy(dtype=float)
        there = np.sum(~np.isnan(values), axis=0)
        means = _mean_and_limits(values, resamples(seeds, list(opening.values())))
        for name, count, *limits in zip(names, there, *means, strict=True):
            row = {**opening, "measure": name}
            row |= dict(zip(("mean", "low", "high"), limits, strict=True))
            rows.append({**row, "seeds": len(seeds), "demonstrations": int(count)})
    return pd.DataFrame(rows)


def rank_curve(ranks: pd.DataFrame) -> pd.DataFrame:
    """Ranks of the truth over the subsets of a group, for each number of demonstrations.

    Args:
        ranks: opening columns up to `seed`, `demonstrations`, `subset`, `reachable`, `rank`, and
            columns whose means are shares: of truth values, or between 0 and 1.

    Returns:
        The opening columns but `seed`; `demonstrations`; `median`, `q10`, `q25`, `q75`, `q90` of
        the rank; `median_low`, `median_high`; each share with `<share>_low` and `<share>_high`;
        how many `seeds`.
    """
    rows = []
    for opening, group in _groups(ranks, ["demonstrations", "subset"]):
        shares = _columns_after(group, "rank")
        for size, subsets in group.groupby("demonstrations"):
            seeds = _sizes(subsets)
            counts = resamples(seeds, [*opening.values(), str(size)])
            rank = subsets["rank"].to_numpy(dtype=float)
            quantiles = _quantiles(rank[:, None], [0.5, 0.10, 0.25, 0.75, 0.90])[:, 0]
            limits = _quantiles(_medians(rank, counts)[:, None], TAILS)[:, 0]
            row = {**opening, "demonstrations": size}
            row |= dict(zip(("median", "q10", "q25", "q75", "q90"), quantiles, strict=True))
            row |= dict(zip(("median_low", "median_high"), limits, strict=True))
            means = _mean_and_limits(subsets[shares].to_numpy(dtype=float), counts)
            for name, *values in zip(shares, *means, strict=True):
                row |= dict(zip((name, f"{name}_low", f"{name}_high"), values, strict=True))
            rows.append({**row, "seeds": len(seeds)})
    return pd.DataFrame(rows)


def area_curve(areas: pd.DataFrame) -> pd.DataFrame:
    """How well each method covers the truth, for each number of demonstrations of a group.

    Args:
        areas: opening columns up to `seed`, `demonstrations`, `subset`, `method`, and columns whose
            means count; NaN is no value.

    Returns:
        The opening columns but `seed`; `demonstrations`, `method`; the mean of each other column
        with `_low` and `_high`; how many `seeds`.
    """
    return _mean_curve(areas, "method", "method")


def control_curve(ranks: pd.DataFrame) -> pd.DataFrame:
    """Where the true range of controls is, for each number of demonstrations of a group.

    Args:
        ranks: opening columns up to `seed`, `demonstrations`, `subset`, `calibrated`, `first`, and
            columns whose means count; NaN is no value.

    Returns:
        As of `area_curve`, with `calibrated` in place of `method`.
    """
    return _mean_curve(ranks, "calibrated", "first")


def joint_curve(ranks: pd.DataFrame) -> pd.DataFrame:
    """What is believed of regions and controls at once, by the number of demonstrations.

    Args:
        ranks: opening columns up to `seed`, `demonstrations`, `subset`, names of the most probable
            pair, and columns whose means count; NaN is no value.

    Returns:
        As of `area_curve`, without `method`.
    """
    one = ranks.assign(first_region="")  # of one kind
    return _mean_curve(one, "first_region", "first_controls").drop(columns="first_region")


def _mean_curve(table: pd.DataFrame, kind: str, last: str) -> pd.DataFrame:
    """Means of the columns after the last key, for each number of demonstrations and each kind."""
    rows = []
    for opening, group in _groups(table, ["demonstrations", "subset"]):
        names = _columns_after(group, last)
        for (size, value), subsets in group.groupby(["demonstrations", kind], sort=False):
            seeds = _sizes(subsets)
            counts = resamples(seeds, [*opening.values(), str(size)])  # alike for all kinds
            row = {**opening, "demonstrations": size, kind: value}
            means = _mean_and_limits(subsets[names].to_numpy(dtype=float), counts)
            for name, *values in zip(names, *means, strict=True):
                row |= dict(zip((name, f"{name}_low", f"{name}_high"), values, strict=True))
            rows.append({**row, "seeds": len(seeds)})
    return pd.DataFrame(rows)


def generator(key: Sequence[str]) -> np.random.Generator:
    """A random stream of its own for each key."""
    state = np.frombuffer(hashlib.sha256("\0".join(key).encode()).digest(), dtype="<u4")
    return np.random.default_rng(state)


def resamples(sizes: Ints, key: Sequence[str]) -> Ints:
    """How often each row is drawn by each resample of the two-level bootstrap.

    Args:
        sizes: (S,) rows of each seed, which stand one seed after the other.
        key: what tells these resamples from all others.

    Returns:
        (B, N) counts of the N rows in B resamples.
    """
    rng = generator(key)
    first = np.concatenate([[0], np.cumsum(sizes)])
    seed = rng.integers(0, len(sizes), (RESAMPLES, len(sizes)))
    counts = np.empty((RESAMPLES, first[-1]), dtype=np.intp)
    at_once = max(1, _DRAWS_AT_ONCE // int(len(sizes) * sizes.max()))
    for begin in range(0, RESAMPLES, at_once):
        seeds = seed[begin : begin + at_once]
        size = sizes[seeds][..., None]
        share = rng.random((*seeds.shape, sizes.max()), dtype=np.float32)
        row = np.arange(len(seeds))[:, None, None] * first[-1] + first[seeds][..., None]
        row = row + (share * size).astype(np.intp)
        if sizes.min() < sizes.max():
            # A seed with fewer rows than the largest takes as many of the draws as it has rows.
            row = row[np.broadcast_to(np.arange(sizes.max()) < size, row.shape)]
        total = np.bincount(row.ravel(), minlength=len(seeds) * first[-1])
        counts[begin : begin + at_once] = total.reshape(len(seeds), first[-1])
    return counts


def _read(path: Path) -> pd.DataFrame:
    """A collated table, with its opening columns as they are spelt."""
    names = list(pd.read_csv(path, nrows=0).columns)
    end = names.index(LAST_OPENING)
    opening, rest = names[:end], names[end:]
    return pd.read_csv(
        path,
        dtype=dict.fromkeys(opening, str),
        keep_default_na=False,
        na_values={name: ["", "nan"] for name in rest},
    )


def _groups(table: pd.DataFrame, order: list[str]) -> Iterator[tuple[dict[str, str], pd.DataFrame]]:
    """Each group with its opening columns, by size or name; its rows by seed, then `order`."""
    opening = list(table.columns)[: list(table.columns).index(LAST_OPENING)]
    rows = table.sort_values([LAST_OPENING, *order], kind="stable")
    groups = dict(iter(rows.groupby(opening, sort=False, observed=True)))
    for key in sorted(groups, key=lambda key: [_by_size(str(value)) for value in key]):
        yield dict(zip(opening, map(str, key), strict=True)), groups[key]


def _columns_after(table: pd.DataFrame, name: str) -> list[str]:
    """The columns to the right of one."""
    names = list(table.columns)
    return names[names.index(name) + 1 :]


def _by_size(value: str) -> tuple[float, str]:
    """Sorts numbers by size, then words."""
    try:
        return float(value), ""
    except ValueError:
        return np.inf, value


def _sizes(group: pd.DataFrame) -> Ints:
    """(S,) rows of each seed."""
    return np.unique(group[LAST_OPENING], return_counts=True)[1]


def _mean_and_limits(values: Floats, counts: Ints) -> tuple[Floats, Floats, Floats]:
    """(M,) means of columns (N, M) over what is there, and the ends of their intervals."""
    weights = np.vstack([np.ones(len(values)), counts])  # as floats: BLAS does no integers
    there = ~np.isnan(values)
    with np.errstate(invalid="ignore"):  # a resample may have nothing of a column
        count = weights.sum(axis=1)[:, None] if there.all() else weights @ there.astype(float)
        means = weights @ np.where(there, values, 0.0) / count
    low, high = _quantiles(means[1:], TAILS)
    return means[0], low, high


def _medians(values: Floats, counts: Ints) -> Floats:
    """(B,) medians of the values that are there, each as often as counted; NaN of none."""
    order = np.argsort(values, kind="stable")[: int(np.sum(~np.isnan(values)))]
    if not len(order):
        return np.full(len(counts), np.nan)
    distinct, first = np.unique(values[order], return_index=True)
    passed = np.cumsum(np.add.reduceat(counts[:, order], first, axis=1), axis=1)
    total = passed[:, -1:]
    middle = [
        distinct[np.minimum(np.sum(passed <= place, axis=1), len(distinct) - 1)]
        for place in ((total - 1) // 2, total // 2)
    ]
    return np.where(total[:, 0] > 0, (middle[0] + middle[1]) / 2, np.nan)


def _quantiles(values: Floats, shares: Sequence[float]) -> Floats:
    """(Q, M) quantiles of columns (N, M) over what is there; NaN of a column of NaN."""
    if not np.isnan(values).any():  # numpy goes through the columns one by one otherwise
        return np.asarray(np.quantile(values, shares, axis=0))
    with catch_warnings():
        simplefilter("ignore", RuntimeWarning)  # numpy's, of a column of NaN
        return np.asarray(np.nanquantile(values, shares, axis=0))
