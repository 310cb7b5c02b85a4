"""Reliability against sums by hand, and its intervals against resamples that are written out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest

from experiments.collate import reliability as module
from experiments.collate.intervals import resamples
from experiments.collate.reliability import reliability
from experiments.config.settings import NO_TRUTH

KEY = ["12", "model", "1", "each"]


def world(
    truth: str, prior: float, hits: Sequence[int], count: int = 1, number: int = 3, seed: int = 0
) -> pd.DataFrame:
    """Sets of a world, each with `count` beliefs of probability 0.0125 in one bin."""
    return pd.DataFrame(
        {
            "truth": truth,
            "cells": 12,
            "seed": seed,
            "source": "model",
            "prior": prior,
            "sets": len(hits),
            "set": range(len(hits)),
            "demonstrations": 1,
            "belief": "each",
            "bin": number,
            "count": count,
            "predicted": 0.0125 * count,
            "hits": hits,
        }
    )


def test_sets_weigh_as_much_as_their_world_divided_by_its_sets() -> None:
    table = pd.concat([world("c1", 0.4, [1, 0]), world("c2", 0.1, [1])])
    (row,) = reliability(table).to_dict("records")
    assert row["observed"] == pytest.approx((0.2 * 1 + 0.1 * 1) / (0.2 * 2 + 0.1))
    assert row["predicted"] == pytest.approx(0.0125)
    assert (row["count"], row["weight"], row["bin"]) == (3, 1.0, 3)
    assert (row["lower"], row["upper"]) == (0.01, 0.02)
    assert "truth" not in row
    assert "seed" not in row


def test_sets_of_all_seeds_share_the_weight_of_their_world() -> None:
    seeds = pd.concat([world("c1", 0.4, [1], seed=0), world("c1", 0.4, [0, 0, 0], seed=1)])
    (row,) = reliability(pd.concat([seeds, world("c2", 0.4, [1])])).to_dict("records")
    assert row["observed"] == pytest.approx((0.1 + 0.4) / 0.8)


def test_weight_is_the_share_of_all_beliefs_of_the_kind() -> None:
    low, high = world("c1", 0.5, [0, 1], count=3), world("c1", 0.5, [1, 1], number=11)
    table = reliability(pd.concat([low, high]))
    assert table["weight"].tolist() == pytest.approx([6 / 8, 2 / 8])
    assert table["count"].tolist() == [6, 2]


def test_bins_reach_from_below_zero_to_above_one() -> None:
    table = pd.concat([world("c1", 0.5, [1], number=number) for number in range(13)])
    found = reliability(table)
    assert found["lower"].tolist() == [-np.inf, *module.EDGES]
    assert found["upper"].tolist() == [*module.EDGES, np.inf]


def test_interval_is_of_95_percent_over_worlds_and_their_sets() -> None:
    hits = np.array([1, 1, 0, 1, 0, 0, 0, 1, 0, 0])
    table = pd.concat([world("c1", 0.2, hits[:4].tolist()), world("c2", 0.2, hits[4:].tolist())])
    (row,) = reliability(table).to_dict("records")
    weight = np.repeat([0.05, 0.2 / 6], [4, 6])
    counts = resamples(np.array([4, 6]), [*KEY, "True"])
    shares = [np.sum(w * hits) / np.sum(w) for w in counts * weight]
    expected = np.quantile(shares, [0.025, 0.975])
    assert [row["low"], row["high"]] == pytest.approx(expected.tolist())


def test_sets_of_the_world_without_a_truth_are_drawn_alone() -> None:
    """Its sets are as many worlds; no resample mixes them with the others."""
    hits = np.random.default_rng(0).integers(0, 2, 20)
    parts = [world("c1", 0.3, hits[:5].tolist()), world(NO_TRUTH, 0.5, hits[5:].tolist())]
    (row,) = reliability(pd.concat(parts)).to_dict("records")
    counts = np.hstack(
        [
            resamples(np.array([5]), [*KEY, "True"]),
            resamples(np.ones(15, dtype=np.int64), [*KEY, "False"]),
        ]
    )
    weight = np.repeat([0.3 / 5, 0.5 / 15], [5, 15])
    shares = [np.sum(w * hits) / np.sum(w) for w in counts * weight]
    expected = np.quantile(shares, [0.025, 0.975])
    assert [row["low"], row["high"]] == pytest.approx(expected.tolist())


def test_kinds_of_belief_stand_apart() -> None:
    one = world("c1", 0.5, [1])
    parts = [one, one.assign(belief="none"), one.assign(demonstrations=10), one.assign(cells=100)]
    found = reliability(pd.concat([part.assign(hits=i % 2) for i, part in enumerate(parts)]))
    keys = found[["cells", "demonstrations", "belief"]].to_numpy().tolist()
    assert keys == [[12, 1, "each"], [12, 1, "none"], [12, 10, "each"], [100, 1, "each"]]
    assert found["observed"].tolist() == [0.0, 1.0, 0.0, 1.0]
