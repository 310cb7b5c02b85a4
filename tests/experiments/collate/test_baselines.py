"""Differences of methods from ours, against means and resamples by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from experiments.collate.baselines import baseline_differences


def table(worse: float) -> pd.DataFrame:
    """Two truths, of two seeds and of one; a method whose share is less than ours by `worse`."""
    shares = {("c1", 0): 0.9, ("c1", 1): 0.7, ("cell_3", 0): 0.5}
    rows = []
    for (truth, seed), share in shares.items():
        for method, top in (("ours", share), ("uniform", share - worse)):
            row = {"truth": truth, "cells": 400, "seed": seed, "method": method}
            rows.append({**row, "demonstrations": 9, "rank": 10 - 10 * top,
                         "log_rank": -top, "top": top, "first": 0.0})  # fmt: skip
    return pd.DataFrame(rows).sample(frac=1, random_state=0)


def test_differences_are_paired_and_points_weigh_alike() -> None:
    rows = baseline_differences(table(0.2)).set_index("method")
    ours, other = rows.loc["ours"], rows.loc["uniform"]
    assert ours["top"] == pytest.approx(0.7)
    assert other["top"] == pytest.approx(0.5)
    # The same difference in every point has no width, however its parts vary.
    for column in ("top_less_ours", "top_less_ours_low", "top_less_ours_high"):
        assert other[column] == pytest.approx(-0.2)
        assert ours[column] == 0
    assert other["log_rank_less_ours"] == pytest.approx(0.2)
    assert other["rank_less_ours"] == pytest.approx(2)
    assert (other["truths"], other["points"], other["demonstrations"]) == (2, 3, 9)
    # Cell 3 alone is drawn in a quarter of resamples; c1 alone with three of four draws of seed 0
    # in a sixteenth, and with all four in a sixtieth, which is too seldom.
    assert ours["top_low"] == pytest.approx(0.5)
    assert ours["top_high"] == pytest.approx(0.85)
    assert np.isfinite(rows.drop(columns=[]).select_dtypes("number")).all().all()
