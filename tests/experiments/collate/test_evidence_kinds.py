"""Kinds of evidence against sums by hand, and their intervals against resamples written out."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest

from experiments.collate.evidence_kinds import CHANCES, LEAST, evidence_kinds
from experiments.collate.intervals import resamples

# Two worlds with a truth and three sets without: best, right, of_truth, top.
SETS = {
    ("cell_0", 0): (0.15, 1, 0.15, 1),
    ("cell_1", 0): (0.12, 0, 0.0, 0),
    ("none", 0): (0.55, 0, 0.3, np.nan),
    ("none", 1): (0.05, 0, 0.8, np.nan),
    ("none", 2): (0.45, 0, 0.4, np.nan),
}
WEIGHTS = np.array([0.25, 0.25, 0.5 / 3, 0.5 / 3, 0.5 / 3])


def table(**shift: float) -> pd.DataFrame:
    """The sets read with kinds of evidence; the truth's posterior is a kind's multiple of it."""
    rows = []
    for kind, factor in shift.items():
        for (truth, number), (best, right, of_truth, top) in SETS.items():
            rows.append(
                {
                    "truth": truth,
                    "cells": 12,
                    "seed": 0,
                    "prior": 0.5 if truth == "none" else 0.25,
                    "sets": 3 if truth == "none" else 1,
                    "set": number,
                    "demonstrations": 5,
                    "evidence": kind.replace("_", " "),
                    "best": best,
                    "right": right,
                    "of_truth": of_truth * factor,
                    "top": top * (factor == 1),
                    "feasible": 7,
                }
            )
    return pd.DataFrame(rows)


def test_scores_are_means_over_worlds_by_their_prior() -> None:
    (row,) = evidence_kinds(table(paper=1.0)).to_dict("records")
    best, _, of_truth, _ = np.array(list(SETS.values())).T
    assert row["best"] == pytest.approx(WEIGHTS @ best)
    assert row["right"] == pytest.approx(0.25)
    assert row["log_truth"] == pytest.approx(WEIGHTS @ np.log(np.maximum(of_truth, LEAST)))
    assert row["top"] == pytest.approx(0.5)
    # Bins: two truths in 0.1 to 0.2; 0.55 and 0.45 in 0.4 to 0.6; 0.05 in 0.05 to 0.1.
    off = abs(0.25 * (0.15 - 1) + 0.25 * 0.12) + (0.55 + 0.05 + 0.45) / 6
    assert row["off_by"] == pytest.approx(off)
    assert (row["worlds"], row["sets"], row["cells"]) == (3, 5, 12)
    assert "seed" not in row
    assert "truth" not in row


def test_differences_are_of_the_same_sets() -> None:
    """One kind is always twice as sure of the truth: no interval, but where a posterior is 0."""
    without_zero = table(paper=0.25, model_error_0=0.5, model_error_1=0.4, calibrated=1.0)
    without_zero = without_zero[without_zero["truth"] != "cell_1"]
    found = evidence_kinds(without_zero).set_index("evidence")
    over_paper = ["log_over_paper", "log_over_paper_low", "log_over_paper_high"]
    over_fixed = ["log_over_fixed", "log_over_fixed_low", "log_over_fixed_high"]
    row = found.loc["calibrated"]
    assert row[over_paper].tolist() == pytest.approx([np.log(4)] * 3)
    assert row[over_fixed].tolist() == pytest.approx([np.log(2)] * 3)
    assert row["top_over_paper"] == pytest.approx(1.0)
    assert found.loc["paper", over_paper].tolist() == [0, 0, 0]


def test_intervals_are_over_worlds_and_over_sets_without_a_truth() -> None:
    (row,) = evidence_kinds(table(paper=1.0)).to_dict("records")
    key = ["12", "5"]
    counts = np.hstack(
        [
            resamples(np.array([1, 1]), [*key, "False"]),
            resamples(np.ones(3, dtype=np.int64), [*key, "True"]),
        ]
    )
    right = np.array([1, 0, 0, 0, 0])
    shares = [np.sum(w * right) / np.sum(w) for w in counts * WEIGHTS]
    expected = np.quantile(shares, [0.025, 0.975])
    assert [row["right_low"], row["right_high"]] == pytest.approx(expected.tolist())


def test_what_chance_leaves_is_over_all_outcomes_by_their_probability() -> None:
    (row,) = evidence_kinds(table(paper=1.0)).to_dict("records")
    best, bins = np.array([each[0] for each in SETS.values()]), ((0, 1), (2, 4), (3,))
    off, weight = [], []
    for right in itertools.product((0, 1), repeat=5):
        excess = WEIGHTS * (best - np.array(right))
        off.append(sum(abs(excess[list(inside)].sum()) for inside in bins))
        weight.append(np.prod(np.where(right, best, 1 - best)))
    mean = np.dot(weight, off)
    spread = np.sqrt(np.dot(weight, np.square(off)) - mean**2)
    assert row["by_chance"] == pytest.approx(mean, abs=4 * spread / np.sqrt(CHANCES))
    order = np.argsort(off)
    below = np.cumsum(np.array(weight)[order])
    # Between the quantiles that 1000 draws can take for the 95 % one.
    low, high = (np.array(off)[order][np.searchsorted(below, share)] for share in (0.92, 0.98))
    assert low <= row["by_chance_high"] <= high


def test_a_posterior_that_is_an_edge_but_for_rounding_stays_in_its_bin() -> None:
    """0.1 is where two bins meet, and 0.15 is in the upper one."""
    rows = table(paper=1.0)
    off = set()
    for best in (0.1, np.nextafter(0.1, 0), np.nextafter(0.1, 1)):
        rows.loc[rows["best"] == 0.12, "best"] = best
        off.update(evidence_kinds(rows)["off_by"].round(12))
        rows.loc[rows["best"] == best, "best"] = 0.12
    assert len(off) == 1
