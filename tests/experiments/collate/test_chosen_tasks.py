"""Chosen against random tasks: survival by scipy's Kaplan and Meier, and by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.stats import CensoredData, ecdf

from experiments.collate.chosen_tasks import chosen_tasks, early_overlap, unfound


def table(chosen: list[float], random: list[float], tried: list[int], truth: str) -> pd.DataFrame:
    """The rows of one source in two points, half of the repetitions each."""
    count = len(chosen)
    rows = [
        {
            "truth": truth,
            "cells": 4,
            "seed": 2 * number // count,
            "source": "model",
            "repetition": number,
            "way": way,
            "tried": tried[number],
            "sure": values[number],
            "settled": np.nan,
            "best_overlaps": number % 2,
            "two_overlap": 0,
            "area_overlaps": np.nan,
            "likeliest_overlaps": 1,
            "likeliest_precision": 0.5,
            "likeliest_share": 0.1,
        }
        for number in range(count)
        for way, values in (("chosen", chosen), ("random", random))
    ]
    return pd.DataFrame(rows)


def test_shares_are_those_of_kaplan_and_meier() -> None:
    """Some stop early, and so are censored before others find the truth."""
    rng = np.random.default_rng(0)
    tried = rng.integers(5, 11, 40)
    event = rng.integers(1, 14, 40)
    found = np.where(event <= tried, event, np.nan)
    rows = unfound(table(found.tolist(), found.tolist(), tried.tolist(), "c1"))
    curve = rows[(rows["until"] == "sure") & (rows["way"] == "chosen")]
    last = np.minimum(event, tried)
    survival = ecdf(CensoredData.right_censored(last, event > tried)).sf
    expected = survival.evaluate(np.arange(tried.max() + 1))
    np.testing.assert_allclose(curve["share"], expected, atol=1e-12)
    assert np.all(curve["share_low"] <= curve["share"] + 1e-12)
    assert np.all(curve["share_high"] >= curve["share"] - 1e-12)


def test_medians_ratios_and_who_never_finds_it() -> None:
    nan = float("nan")
    rows = chosen_tasks(table([2, 2, 3, nan], [4, 6, 8, nan], [10] * 4, "c1"))
    row = rows[rows["until"] == "sure"].iloc[0]
    assert (row["chosen_median"], row["random_median"]) == (2, 6)
    assert row["median_ratio"] == pytest.approx(1 / 3)
    assert row["chosen_share"] == 0.75
    assert row["chosen_mean"] == pytest.approx((2 + 2 + 3 + 10) / 4)
    assert row["mean_ratio"] == pytest.approx((2 + 2 + 3 + 10) / (4 + 6 + 8 + 10))
    assert (row["points"], row["repetitions"], row["longest"]) == (2, 4, 10)
    assert row["chosen_median_low"] <= 2 <= row["chosen_median_high"]
    never = rows[rows["until"] == "settled"].iloc[0]
    assert np.isinf(never["chosen_median"])
    assert np.isnan(never["median_ratio"])
    assert never["chosen_share"] == 0


def test_a_ratio_to_a_median_that_is_never_met_is_an_upper_bound() -> None:
    nan = float("nan")
    rows = chosen_tasks(table([2, 2, 2, 2], [nan, nan, nan, 5], [10] * 4, "c1"))
    row = rows[rows["until"] == "sure"].iloc[0]
    assert np.isinf(row["random_median"])
    assert row["median_ratio"] == pytest.approx(2 / 11)


def test_all_truths_together_have_a_row_of_their_own() -> None:
    rows = chosen_tasks(
        pd.concat([table([1] * 4, [5] * 4, [9] * 4, "c1"), table([3] * 4, [5] * 4, [9] * 4, "c2")])
    )
    sure = rows[rows["until"] == "sure"].set_index("truth")
    assert sure["chosen_median"].to_dict() == {"c1": 1, "c2": 3, "all": 1}
    assert sure.loc["all", "points"] == 4
    assert sure.loc["all", "chosen_mean"] == pytest.approx(2)
    assert (sure.loc["c1", "chosen_mean_low"], sure.loc["c1", "chosen_mean_high"]) == (1, 1)


def test_overlap_after_five_demonstrations() -> None:
    rows = early_overlap(table([1] * 4, [2] * 4, [9] * 4, "c1")).set_index("way")
    assert rows.loc["chosen", "best_overlaps"] == 0.5
    assert rows.loc["chosen", "best_overlaps_low"] < 0.5 < rows.loc["chosen", "best_overlaps_high"]
    assert rows.loc["random", "two_overlap"] == 0
    assert np.isnan(rows.loc["random", "area_overlaps"])
