"""Methods compared on the same demonstrations, with intervals over truths and seeds."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.collate.finished import LAST_OPENING
from experiments.collate.intervals import TAILS, resamples

OURS = "ours"
_MEASURES = ("rank", "log_rank", "top", "first")


def baseline_differences(table: pd.DataFrame) -> pd.DataFrame:
    """Means of each method over points, and of its difference from ours.

    Each point, a truth and a seed, weighs the same. The bootstrap has two levels: a resample draws
    as many truths as there are, with replacement, and from each drawn truth as many of its seeds.

    Args:
        table: the collated `baselines`: opening columns up to `seed`, then `method`,
            `demonstrations`, and the measures `rank`, `log_rank`, `top` and `first`.

    Returns:
        The opening columns but those of truth and seed; `method`, `demonstrations`; number of
        `truths` and `points`; each measure, and `<measure>_less_ours`, its difference from ours on
        the same points, all with `_low` and `_high`.
    """
    names = list(table.columns)
    opening = [name for name in names[: names.index(LAST_OPENING)] if not name.startswith("truth")]
    rows = []
    for key, group in table.groupby([*opening, "demonstrations"], sort=True, dropna=False):
        wide = {
            name: group.pivot(index=["truth", LAST_OPENING], columns="method", values=name)
            for name in _MEASURES
        }
        points = wide["rank"].index  # in order of truths
        sizes = np.unique(points.get_level_values("truth"), return_counts=True)[1]
        counts = resamples(sizes, [*map(str, key), "baselines"]).astype(float)
        counts = np.vstack([np.ones(len(points)), counts])
        weight = counts / counts.sum(axis=1, keepdims=True)
        for method in wide["rank"].columns:
            row = dict(zip([*opening, "demonstrations"], key, strict=True))
            row |= {"method": method, "truths": len(sizes), "points": len(points)}
            for name, values in wide.items():
                own = values[method].to_numpy()
                for column, of in (
                    (name, own),
                    (f"{name}_less_ours", own - values[OURS].to_numpy()),
                ):
                    means = weight @ of
                    low, high = np.quantile(means[1:], TAILS)
                    row |= {column: means[0], f"{column}_low": low, f"{column}_high": high}
            rows.append(row)
    return pd.DataFrame(rows)
