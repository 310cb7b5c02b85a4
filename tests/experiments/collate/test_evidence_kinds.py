"""Kinds of evidence against sums by hand, and their intervals against resamples written out."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from experiments.collate.evidence_kinds import evidence_kinds
from experiments.collate.intervals import resamples

# Sets of ten a point, by bin: two worlds with a truth, and three points of the one without.
# truth, seed, bin, count, and sums of best, right, log_truth, top.
ROWS = [
    ("cell_0", 0, 6, 6, 0.9, 4, -3.0, 5),
    ("cell_0", 0, 8, 4, 2.0, 1, -8.0, 1),
    ("cell_1", 0, 6, 10, 1.2, 0, -30.0, 0),
    ("none", 0, 8, 10, 5.5, 0, -9.0, np.nan),
    ("none", 1, 5, 10, 0.6, 0, -1.0, np.nan),
    ("none", 2, 8, 3, 1.5, 0, -4.0, np.nan),
    ("none", 2, 5, 7, 0.5, 0, -2.0, np.nan),
]
WEIGHT = {"cell_0": 0.25 / 10, "cell_1": 0.25 / 10, "none": 0.5 / 30}  # of a set
VALUES = ("count", "best", "right", "log_truth", "top")


def table(**shift: float) -> pd.DataFrame:
    """The sets read with kinds of evidence: a kind's log posterior of the truth is less by that."""
    rows = []
    for kind, less in shift.items():
        for truth, seed, place, *values in ROWS:
            opening = {"truth": truth, "cells": 12, "seed": seed}
            opening |= {"prior": 0.5 if truth == "none" else 0.25, "sets": 10}
            opening |= {"demonstrations": 5, "evidence": kind.replace("_", " "), "bin": place}
            row = {**opening, **dict(zip(VALUES, values, strict=True))}
            row["log_truth"] -= less * row["count"]
            row["top"] *= less == 0
            rows.append(row)
    return pd.DataFrame(rows)


def off_by(points: dict[tuple[str, int], int]) -> tuple[float, dict[int, float]]:
    """Distance from what is right with each point as often as given, and the excess of each bin."""
    total, excess = 0.0, dict.fromkeys((5, 6, 8), 0.0)
    for truth, seed, place, count, best, right, *_ in ROWS:
        weight = points[truth, seed] * WEIGHT[truth]
        total += weight * count
        excess[place] += weight * (best - right)
    by_bin = {place: value / total for place, value in excess.items()}
    return sum(map(abs, by_bin.values())), by_bin


ONCE = {(truth, seed): 1 for truth, seed, *_ in ROWS}


def drawn() -> list[dict[tuple[str, int], int]]:
    """How often each point is drawn: worlds with a truth, and points without one."""
    key = ["12", "5"]
    cells = resamples(np.array([1, 1]), [*key, "True"])
    none = resamples(np.ones(3, dtype=np.int64), [*key, "False"])
    return [dict(zip(ONCE, map(int, each), strict=True)) for each in np.hstack([cells, none])]


def test_scores_are_means_over_worlds_by_their_prior() -> None:
    (row,) = evidence_kinds(table(paper=0.0)).to_dict("records")
    sums = {
        name: sum(WEIGHT[each[0]] * each[3 + i] for each in ROWS) for i, name in enumerate(VALUES)
    }
    assert sums["count"] == pytest.approx(1)
    for name in ("best", "right", "log_truth"):
        assert row[name] == pytest.approx(sums[name])
    assert row["top"] == pytest.approx(6 / 20)
    assert row["off_by"] == pytest.approx(off_by(ONCE)[0])
    assert (row["worlds"], row["sets"], row["cells"]) == (5, 50, 12)
    assert "seed" not in row
    assert "truth" not in row


def test_differences_are_of_the_same_sets() -> None:
    """One kind always has a truth twice as probable, so that there is no interval."""
    four, two, more = np.log(4), np.log(2), np.log(2.5)
    kinds = table(paper=four, model_error_0=two, model_error_1=more, calibrated=0.0)
    found = evidence_kinds(kinds).set_index("evidence")
    over_paper = ["log_over_paper", "log_over_paper_low", "log_over_paper_high"]
    over_fixed = ["log_over_fixed", "log_over_fixed_low", "log_over_fixed_high"]
    row = found.loc["calibrated"]
    assert row[over_paper].tolist() == pytest.approx([four] * 3)
    assert row[over_fixed].tolist() == pytest.approx([two] * 3)
    assert row["top_over_paper"] == pytest.approx(0.3)
    assert found.loc["paper", over_paper].tolist() == [0, 0, 0]


def test_intervals_are_over_worlds_and_over_points_without_a_truth() -> None:
    (row,) = evidence_kinds(table(paper=0.0)).to_dict("records")
    expected = np.quantile([off_by(points)[0] for points in drawn()], [0.025, 0.975])
    assert [row["off_by_low"], row["off_by_high"]] == pytest.approx(expected.tolist())


def test_chance_is_how_far_other_worlds_are_from_these() -> None:
    (row,) = evidence_kinds(table(paper=0.0)).to_dict("records")
    _, here = off_by(ONCE)
    apart = [
        sum(abs(there[place] - here[place]) for place in here)
        for there in (off_by(points)[1] for points in drawn())
    ]
    assert row["by_chance"] == pytest.approx(np.mean(apart))
    assert row["by_chance_high"] == pytest.approx(np.quantile(apart, 0.95))


def test_chance_is_what_calibrated_worlds_are_off_by() -> None:
    """50 studies of 60 worlds whose sets share demonstrations, right as often as they say."""
    rng, off, chance = np.random.default_rng(0), [], []
    for study in range(50):
        probability = rng.choice([0.15, 0.3, 0.5], 60)
        rows = [
            ("none" if world < 20 else f"cell_{world}", world, int(np.searchsorted([0.2, 0.4], p)))
            for world, p in enumerate(probability)
        ]
        table = pd.DataFrame(rows, columns=["truth", "seed", "bin"]).assign(
            cells=study, prior=0.0, sets=10, demonstrations=5, evidence="paper", count=10
        )
        table["prior"] = np.where(table["truth"] == "none", 1 / 3, 1 / 60)
        # All ten sets of a world are right, or none of them: they are as one.
        table["best"], table["right"] = 10 * probability, 10 * (rng.random(60) < probability)
        opening = ["truth", "cells", "seed", "prior", "sets", "demonstrations", "evidence", "bin"]
        table = table.assign(log_truth=-1.0, top=1.0)[[*opening, *VALUES]]
        (row,) = evidence_kinds(table).to_dict("records")
        off.append(row["off_by"])
        chance.append(row["by_chance"])
    assert np.mean(off) == pytest.approx(np.mean(chance), rel=0.15)
    assert np.std(off) / np.sqrt(50) < 0.06 * np.mean(off)
