"""Published numbers beside ours: false positives among what Scobee and Sastry's rule selects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from experiments.field.leaderboard import interval
from experiments.field.ours import greedy
from experiments.field.worlds import scobee

# Share of the selected constraints that are not true, by number of demonstrations: Scobee and
# Sastry (2020), Figure 3, means over ten sets of demonstrations.
FALSE_SHARES = {1: 0.3139, 2: 0.2319, 5: 0.1212, 10: 0.0393, 20: 0.0, 50: 0.0, 100: 0.0}


def false_shares(seeds: Sequence[int]) -> pd.DataFrame:
    """A row for each number of demonstrations.

    `published`, and of ours `mean`, `lower` and `upper` over seeds, and `selected`, how many are
    selected.
    """
    rows = []
    for count, published in FALSE_SHARES.items():
        false, selected = [], []
        for seed in seeds:
            case = scobee.make(seed, count)
            chosen = greedy(case.problem, np.random.default_rng(seed)).chosen
            assert chosen is not None
            selected.append(int(np.sum(chosen)))
            false.append(float(np.sum(chosen & ~case.truth) / max(selected[-1], 1)))
        ours = interval(np.array(false))
        rows.append(
            {"demonstrations": count, "published": published, **ours, "selected": np.mean(selected)}
        )
    return pd.DataFrame(rows)
