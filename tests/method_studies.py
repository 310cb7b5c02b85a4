"""Tables of studies that were never run: ways to rank, to choose tasks; sampled paths."""

import numpy as np
import pandas as pd

from experiments.collate.chosen_tasks import chosen_tasks, early_overlap, unfound
from paper_figures.baselines import METHODS


def baseline_differences() -> pd.DataFrame:
    """Ours wins against uniform, loses to the nearest, and is not told from the others."""
    less = {"ours": (0.0, 0.0, 0.0), "uniform": (-0.6, -0.7, -0.5), "nearest": (0.1, 0.05, 0.2)}
    rows = []
    for size in (1, 9):
        for method in METHODS:
            row = {"method": method, "demonstrations": size, "truths": 10, "points": 30}
            middle, low, high = less.get(method, (-0.1, -0.2, 0.1))
            for name, at in (("top", 0.7), ("log_rank", 1.0), ("rank", 3.0)):
                for end, value in (("", middle), ("_low", low), ("_high", high)):
                    row[f"{name}_less_ours{end}"] = value
                    row[f"{name}{end}"] = at + value
            rows.append(row)
    return pd.DataFrame(rows)


def chosen_task_tables() -> dict[str, pd.DataFrame]:
    """Two truths, each with eight repetitions: chosen tasks find them in half as many."""
    rows = [
        {
            "truth": truth,
            "cells": 4,
            "seed": number // 4,
            "source": source,
            "repetition": number,
            "way": way,
            "tried": 20,
            "sure": found,
            "settled": found + 1,
            "best_overlaps": number % 2,
            "two_overlap": 0,
            "area_overlaps": np.nan,
            "likeliest_overlaps": way == "chosen",
            "likeliest_precision": 0.5,
            "likeliest_share": 0.1,
        }
        for truth in ("c1", "cell_65")
        for source in ("model", "demonstrator")
        for number in range(8)
        for way, found in (("chosen", 2 + number), ("random", 4 + 2 * number))
    ]
    table = pd.DataFrame(rows)
    return {"chosen_tasks": chosen_tasks(table), "unfound": unfound(table)}


def early_overlap_tables() -> dict[str, pd.DataFrame]:
    """One truth: the area overlaps after all chosen tasks, and after no random ones."""
    rows = [
        {"truth": "pain", "cells": 4, "seed": number // 4, "source": source, "repetition": number}
        | {"way": way, "tried": 10, "sure": np.nan, "settled": 6.0, "best_overlaps": number % 2}
        | {"two_overlap": 0, "area_overlaps": 1, "likeliest_overlaps": way == "chosen"}
        | {"likeliest_precision": 0.5, "likeliest_share": 0.1}
        for source in ("model", "demonstrator")
        for number in range(8)
        for way in ("chosen", "random")
    ]
    table = pd.DataFrame(rows)
    return {"early_overlap": early_overlap(table), "chosen_tasks": chosen_tasks(table)}


def sampled_tables() -> dict[str, pd.DataFrame]:
    """With paths the change goes with the step, beside noise; with cells it goes with its root."""
    opening = [
        {"truth": truth, "cells": cells, "seed": 0} for truth in ("c1", "c2") for cells in (0, 400)
    ]
    halving = [
        {
            **each,
            "step": step,
            "shorter": step / 2,
            "trial": trial,
            "change": (0.1 * step ** (0.5 if each["cells"] else 1)) ** 2 + noise,
            "noise": noise,
        }
        for each in opening
        for noise in [0.0 if each["cells"] else 0.003]
        for step in (1.0, 0.5, 0.25)
        for trial in range(3)
    ]
    scores = {"brier": 0.02, "brier_low": 0.01, "brier_high": 0.03, "off_by": 0.001}
    scores |= {"log_score": -0.1, "log_score_low": -0.2, "log_score_high": -0.05}
    ranks = {"rank": 1.0, "rank_lowest": 1.0, "rank_highest": 2.0, "settled": 3, "doubted": 1}
    curve = {"median": 3.0, "median_low": 2.0, "median_high": 5.0}
    curve |= {"share_top_5": 0.8, "share_top_5_low": 0.7, "share_top_5_high": 0.9}
    return {
        "models": pd.DataFrame([{**each, **scores, **ranks} for each in opening]),
        "halving": pd.DataFrame(halving),
        "rank_curve": pd.DataFrame(
            [
                {"truth": each["truth"], "cells": each["cells"], "demonstrations": count, **curve}
                for each in opening
                for count in (5, 9, 12)
            ]
        ),
    }
