"""Tables of one point: where the truth is in the ranking, and what demonstrations hold of it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from experiments.config.settings import (
    RankSettings,
    Region,
    Settings,
)
from experiments.point.ranking_tables import rank_table
from experiments.point.run import run_point
from experiments.tracking.store import Store
from mlci.evidence import rank_constraints
from mlci.inference import Inference
from mlci.metrics import random_subsets

SHARES = [f"top_{top}_{name}" for top in (1, 2) for name in ("overlap", "inside")]


def walled(settings: Settings, low: float, high: float, keep: int = 8) -> Settings:
    """Ten hypotheses, 0.6 m wide from -3 m on, and a wall where it is told to be."""
    truth = dataclasses.replace(
        settings.truth,
        boxes=(Region((low, None), (high, None)),),
        balls=(),
        half_spaces=(),
        shapes=(),
        name="wall",
        cell=None,
    )
    more = dataclasses.replace(settings.demonstrations, pairs=20, keep=keep)
    ranks = RankSettings(demonstrations=4, subsets=12, top=5)
    fine = dataclasses.replace(settings.grid, shape=(16, 8))
    settings = dataclasses.replace(settings, grid=fine, dt=0.4, horizon=4.0)
    evidence = dataclasses.replace(settings.inference, exact_ends=False, model_error=0.0)
    settings = dataclasses.replace(settings, inference=evidence)
    return dataclasses.replace(settings, truth=truth, demonstrations=more, ranks=ranks)


def inference(settings: Settings, phi: np.ndarray, violated: np.ndarray) -> Inference:
    names = tuple(map(str, range(len(phi))))
    return Inference(settings.candidates, names, 1 - phi, violated, np.ones(len(phi), bool))


def test_shares_are_of_rankings_whose_best_meet_the_truth(settings: Settings) -> None:
    settings = walled(settings, -0.3, 1.5)  # half of hypotheses 4 and 7, and all between
    which = {"overlap": {4, 5, 6, 7}, "inside": {5, 6}}
    rng = np.random.default_rng(4)
    phi = rng.random((9, 10)) * np.where(np.isin(np.arange(10), [5, 6]), 0.95, 0.8)
    violated = rng.random((9, 10)) < 0.05
    table = rank_table(settings, inference(settings, phi, violated), np.random.default_rng(1))
    subsets = random_subsets(9, 4, 12, np.random.default_rng(1))
    best = [
        rank_constraints(1 - phi[subset], violated[subset]).order[:2].tolist()
        for each in subsets
        for subset in each
    ]
    assert len(best) == len(table) == 48
    for (name, good), top in ((part, top) for part in which.items() for top in (1, 2)):
        expected = [set(first[:top]) <= good for first in best]
        np.testing.assert_array_equal(table[f"top_{top}_{name}"], expected)
    means = table[SHARES].mean()
    assert means.between(0.05, 0.95).all()
    assert means.nunique() == 4


def test_no_truth_and_too_few_hypotheses_have_no_shares(settings: Settings) -> None:
    free = dataclasses.replace(
        settings,
        truth=dataclasses.replace(settings.truth, boxes=(), name="none"),
    )
    phi, violated = np.full((3, 10), 0.5), np.zeros((3, 10), dtype=bool)
    rows = rank_table(free, inference(free, phi, violated), np.random.default_rng(0))
    assert rows[SHARES].isna().all(axis=None)
    wide = Region((0.6, None), (1.2, None))
    alone = dataclasses.replace(settings.hypotheses, boxes=(wide,), shape=None)
    alone = dataclasses.replace(settings, hypotheses=alone)
    of_one = inference(alone, phi[:, :1], violated[:, :1])
    rows = rank_table(alone, of_one, np.random.default_rng(0))
    assert (rows[SHARES[:2]] == 1).all(axis=None)
    assert rows[SHARES[2:]].isna().all(axis=None)


def test_first_are_ranked_as_if_there_were_no_more(settings: Settings, tmp_path: Path) -> None:
    many, five = (
        run_point(walled(settings, -0.3, 0.9, keep), Store(tmp_path), lambda line: None)
        for keep in (8, 5)
    )
    assert len(many["trials"]) == 8
    pd.testing.assert_frame_equal(many["first"], five["hypotheses"])
    assert not many["first"]["gain"].equals(many["hypotheses"]["gain"])
    for name in ("first", "hypotheses"):
        table = many[name]
        assert table["hypothesis"][table["overlaps_truth"]].tolist() == [4, 5, 6]
        assert table["hypothesis"][table["covered_by_truth"]].tolist() == [5]


def test_truth_probability_is_that_of_the_likeliest_hypothesis_inside(
    settings: Settings, tmp_path: Path
) -> None:
    one, two = (
        run_point(walled(settings, low, 0.6), Store(tmp_path), lambda line: None)
        for low in (-0.3, -0.6)  # inside are hypothesis 5, and 4 too
    )
    # No demonstration violates the truth, so that every one of them adds to the gain.
    chances = one["trials"]["truth_probability"]
    assert chances.nunique() > 3
    assert np.sum(-np.log1p(-chances)) == pytest.approx(one["hypotheses"]["gain"][5])
    shown = two["probabilities"].set_index("hypothesis")
    assert shown["unconstrained"][4] != shown["unconstrained"][5]
    chance = two["trials"].set_index("trial")["truth_probability"][shown["trial"].iloc[0]]
    assert chance == max(shown["unconstrained"][4], shown["unconstrained"][5])
