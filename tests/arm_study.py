"""Made-up tables of arms and of what tasks cost, small enough to know every number in them."""

import pandas as pd

OPENING = {"truth": "drawn", "cells": 0, "actions": 0, "dt": 0.1, "samples": 0}
CASES = {"arm, six joints": "[6]", "arm, two joints": "[2]"}


def arm_tables() -> dict[str, pd.DataFrame]:
    """Two systems with ten worlds each: of six joints, the truth is first in 6 and second in 2."""
    rows, bins, kept, cases = [], [], [], []
    for case, lengths in CASES.items():
        opening = {"system.arguments.lengths": lengths, **OPENING}
        cases.append({**opening, "case": case, "choice": case, "value": ""})
        for seed in range(10):
            rank = (1.0, 2.0, 5.0)[(seed >= 6) + (seed >= 8)] if case == "arm, six joints" else 1.0
            row = {**opening, "seed": seed, "tasks": 2, "possible": 2, "rank": rank}
            row |= {"rank_lowest": rank, "rank_highest": rank + 1, "posterior": 0.9 / rank}
            row |= {"claim": 0.9, "none": 0.1, "effective": 100.0, "doubted": 1}
            rows.append(row)
            kept.append({**opening, "seed": seed, "demonstrations": 5 - (seed == 9)})
            for lower, forecast in ((0.0, 0.1), (0.5, 0.75)):
                row = {**opening, "seed": seed, "lower": lower, "upper": lower + 0.5}
                crossed = float(seed < 7) if lower else 0.1
                bins.append({**row, "count": 10, "forecast": forecast, "crossed": crossed})
    tables = {"models": rows, "scored": bins, "summary": kept, "cases": cases}
    return {name: pd.DataFrame(table) for name, table in tables.items()}


def dimension_tables() -> dict[str, pd.DataFrame]:
    """Drawing grows with the square of the dimensions and in proportion to samples."""
    machine = {"cpu": "chip", "python": "3", "numpy": "2", "commit": "abc", "date": "2026-01-01"}
    rows = []
    for factor, values, power in (("dimensions", (2, 4, 8), 2), ("samples", (1000, 4000), 1)):
        for value in values:
            size = {"dimensions": 12, "samples": 4000, "steps": 10, "modes": 1, factor: value}
            times = {"search_s": 0.1, "draw_s": 1e-3 * value**power, "task_s": 0.2 * value}
            rows.append({"factor": factor, "value": value, **size, **times, "peak_mb": 200.0})
    return {"dimensions": pd.DataFrame(rows).assign(**machine)}
