"""Made-up tables of the studies of choices, for tests of their figures."""

import numpy as np
import pandas as pd

LIMITS = ("", "_low", "_high")


def groups(rows: list[dict], seed: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables `measures` and `rank_curve` of made-up numbers, for groups with these columns."""
    rng = np.random.default_rng(seed)
    measures, curve = [], []
    for row in rows:
        for name in ("reachable", "final_state_error", "violation_distance"):
            low, mean, high = np.sort(rng.random(3))
            measures.append({**row, "measure": name, "mean": mean, "low": low, "high": high})
        for count in (8, 9, 10):
            low, median, high = np.sort(rng.uniform(1, 50, 3))
            top_low, top, top_high = np.sort(rng.random(3))
            middle = {"median": median, "median_low": low, "median_high": high}
            top = dict(
                zip((f"share_top_5{end}" for end in LIMITS), (top, top_low, top_high), strict=True)
            )
            curve.append({**row, "demonstrations": count, **middle, **top})
    return pd.DataFrame(measures), pd.DataFrame(curve)


def settings_row(cells: int, dt: float, samples: int = 1, truth: str = "c1") -> dict:
    return {"truth": truth, "cells": cells, "actions": 9, "dt": dt, "samples": samples}


def sensitivity_tables() -> dict[str, pd.DataFrame]:
    """Two cases and the default; one of them on 420 cells in place of 400."""
    rows = [
        {"temperature": temperature, **settings_row(cells, dt)}
        for temperature, all_cells in ((1.0, (100, 400, 420)), (2.0, (100, 400)))
        for cells, dt in [*((cells, 0.25) for cells in all_cells), (400, 0.5)]
    ]
    names = [
        "temperature: 2"
        if row["temperature"] == 2
        else "default"
        if row["cells"] != 420
        else "more"
        for row in rows
    ]
    measures, curve = groups(rows, 0)
    cases = pd.DataFrame(rows).assign(case=names, choice=names, value="")
    return {"cases": cases, "measures": measures, "rank_curve": curve}


def in_cell_tables() -> dict[str, pd.DataFrame]:
    rows = [
        settings_row(cells, dt, samples, truth)
        for truth in ("c1", "c2")
        for cells, samples in ((100, 1), (100, 3), (400, 1))
        for dt in (0.1, 0.5)
    ]
    measures, curve = groups(rows, 1)
    return {"measures": measures, "rank_curve": curve}


def calibration_tables() -> dict[str, pd.DataFrame]:
    """Two numbers of demonstrations; bins of few beliefs, and of what is no probability."""
    rows, rng = [], np.random.default_rng(2)
    for source in ("demonstrator", "model"):
        for belief in ("corrected", "each", "none", "printed", "selected"):
            for count in (1, 10):
                for number, lower, upper, beliefs in (
                    (2, 0.005, 0.01, 50),
                    (6, 0.1, 0.2, 20),
                    (8, 0.4, 0.6, 19),
                    (12, 1.0, np.inf, 30),
                ):
                    if (number == 12) != (belief == "printed"):
                        continue
                    low, observed, high = np.sort(rng.random(3))
                    predicted = np.inf if upper == np.inf else rng.uniform(lower, upper)
                    row = {"cells": 400, "source": source, "demonstrations": count}
                    row |= {"belief": belief, "bin": number, "lower": lower, "upper": upper}
                    row |= {"predicted": predicted, "observed": observed, "low": low, "high": high}
                    rows.append({**row, "weight": beliefs / 89, "count": beliefs})
    return {"reliability": pd.DataFrame(rows)}


def known_tables() -> dict[str, dict[str, pd.DataFrame]]:
    """The tables that each figure is drawn from, by its module."""
    return {
        "sensitivity": sensitivity_tables(),
        "in_cell": in_cell_tables(),
        "calibration": calibration_tables(),
    }
