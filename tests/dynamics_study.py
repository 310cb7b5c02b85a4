"""The table of a study of many systems that was never run."""

from __future__ import annotations

import numpy as np
import pandas as pd

from mlci.outlook.outlook import FEATURES


def dynamics(systems: int = 5) -> pd.DataFrame:
    """Eight points a system; `reach` decides, `touched` is the same for all."""
    rng, count = np.random.default_rng(0), 8 * systems
    table = pd.DataFrame(rng.normal(size=(count, len(FEATURES))), columns=list(FEATURES))
    chance = 1 / (1 + np.exp(-3 * table["reach"]))
    front = {
        "truth": [f"cell_{k}" for k in range(count)],
        "cells": np.where(np.arange(count) % 2, 400, 1600),
        "dt": 0.5,
        "samples": 1,
        "seed": 0,
        "system": np.repeat([f"S{k}" for k in range(systems)], 8),
    }
    success = {
        "top": rng.binomial(20, chance) / 20,
        "first": 0.25,
        "log_rank": 1.0,
        "claim": 0.5,
        "violation_distance": np.where(np.arange(count) % 8 < 7, 2.0, np.nan),
        "out_of_reach": 0.0,
    }
    return pd.DataFrame(front).assign(**table.assign(touched=0.3), demonstrations=9, **success)
