"""Tables of two studies that were never run: ways to rank regions, and ways to choose tasks."""

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
