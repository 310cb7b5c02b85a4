"""Beliefs about simulated worlds: by hand, and calibrated where the tabular model is the world."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tiny_point import composed

from experiments.collate.reliability import reliability
from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.point.belief_counts import EDGES, _binned, belief_counts
from experiments.point.inference import PointInference
from experiments.point.run import run_point
from experiments.point.stages import tabular_model
from experiments.tracking.store import Store
from mlci.inference import Inference

WORLDS, SETS = 5, 40
BEYOND = len(EDGES)


def tiny(*words: str) -> Settings:
    """A double integrator with five hypotheses, on a few cells."""
    few = ["system=double_integrator", "hypotheses.shape=[5,null]", "grid.shape=[10,6]"]
    few += ["horizon=2.0", "dt=0.5", "actions=3", "calibration.demonstrations=[1,3]"]
    return read_config(composed(*few, f"calibration.sets={SETS}", *words))[0]


def counts(settings: Settings, store: Store, inference: Inference | None = None) -> pd.DataFrame:
    """The beliefs of a world from some demonstrations of its own, by default none."""
    model = tabular_model(settings, store)
    hypotheses = model.regions.mask(settings.candidates.names)
    shape = 0, len(settings.candidates)
    if inference is None:
        evidence = np.ones(shape), np.zeros(shape, bool), np.zeros(0, bool)
        inference = Inference(settings.candidates, (), *evidence, settings.inference.prior)
    truth = model.regions.mask(settings.constraint.names)
    nothing = np.empty(0, dtype=int)
    point = PointInference(None, nothing, (), model, hypotheses, truth, inference, None)
    return belief_counts(settings, point)


@pytest.fixture(scope="module")
def worlds(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    """The table of every world, drawn from the tabular model."""
    store, tables = Store(tmp_path_factory.mktemp("store")), []
    for words in (["truth=none"], *(["truth=cell", f"truth.cell={i}"] for i in range(WORLDS))):
        settings = tiny("inference.prior=0.4", *words)
        table = counts(settings, store)
        tables.append(table.assign(truth=settings.columns["truth"], seed=0))
    both = pd.concat(tables, ignore_index=True)
    return both[["truth", "seed", *(name for name in both if name not in ("truth", "seed"))]]


def excess(table: pd.DataFrame) -> float:
    """By how many standard errors the beliefs exceed what is right, sets weighed by the prior."""
    weight = table["prior"] / table["sets"]
    off = (weight * (table["predicted"] - table["hits"])).groupby([table["truth"], table["set"]])
    error = np.sqrt(np.square(off.sum()).sum())
    return float(off.sum().sum() / error) if error else 0.0


def test_beliefs_are_calibrated_where_the_model_is_the_world(worlds: pd.DataFrame) -> None:
    assert worlds.groupby("truth")["set"].nunique().min() > SETS / 10
    for belief in ("each", "none", "selected"):
        for count in (1, 3):
            of_kind = worlds.query(f"belief == '{belief}' and demonstrations == {count}")
            assert abs(excess(of_kind)) < 3.5
            for _, of_bin in of_kind.groupby("bin"):
                if of_bin["count"].sum() >= 30:
                    assert abs(excess(of_bin)) < 3.5
    few = worlds.query("demonstrations == 3")
    assert excess(few[few["belief"] == "corrected"]) > 5
    assert (few.loc[few["belief"] == "printed", "bin"] == BEYOND).all()


def test_sets_that_a_truth_cannot_show_are_left_out_and_not_drawn_anew(
    worlds: pd.DataFrame,
) -> None:
    found = worlds.query("belief == 'none'").groupby(["truth", "demonstrations"])["set"].nunique()
    assert found["none"].tolist() == [SETS, SETS]
    for cell in range(WORLDS):
        one, three = found[f"cell_{cell}"]
        assert three < one < SETS
    assert (worlds["sets"] == SETS).all()
    priors = worlds.groupby("truth")["prior"].first()
    assert priors.pop("none") == 0.4
    assert priors.tolist() == pytest.approx([0.6 / WORLDS] * WORLDS)


def test_beliefs_of_demonstrations_by_hand(tmp_path: Path) -> None:
    settings = tiny("truth=cell", "truth.cell=1")
    settings = dataclasses.replace(
        settings, calibration=dataclasses.replace(settings.calibration, sets=0)
    )
    phi = np.array([[0.2, 0.5, 0.0, 0.0, 0.9], [0.0, 0.0, 0.0, 0.0, 0.0], [0.2, 0.8, 0.1, 0, 0]])
    violated = np.array([[0, 0, 1, 0, 0], [1, 0, 0, 0, 0], [0, 0, 0, 0, 1]], dtype=bool)
    reachable = np.array([True, False, True])
    evidence = (np.concatenate([part, part[::-1]]) for part in (1 - phi, violated, reachable))
    inference = Inference(settings.candidates, tuple("abcdef"), *evidence)
    table = counts(settings, Store(tmp_path), inference)
    assert table["source"].unique().tolist() == ["demonstrator"]
    assert (table[["prior", "sets"]] == [0.1, 2]).all(axis=None)

    def rows(count: int, belief: str) -> pd.DataFrame:
        return table.query(f"set == 0 and demonstrations == {count} and belief == '{belief}'")

    def total(count: int, belief: str) -> list[float]:
        return rows(count, belief)[["count", "predicted", "hits"]].sum().tolist()

    # After one: odds 0.5 for none, and 0.1 / (1 - Phi) for those that it does not violate.
    odds = np.array([0.1 / 0.8, 0.1 / 0.5, 0, 0.1, 0.1 / 0.1])
    assert total(1, "none") == pytest.approx([1, 0.5 / (0.5 + odds.sum()), 0])
    assert total(1, "each") == pytest.approx([5, odds.sum() / (0.5 + odds.sum()), 1])
    assert total(1, "selected") == pytest.approx([1, odds[4] / (0.5 + odds.sum()), 0])
    assert total(1, "corrected") == pytest.approx([1, 1 / (1 + 0.1), 0])
    assert total(1, "printed") == pytest.approx([1, 1 / (1 - 0.1), 0])
    # After three, hypothesis 1 is left with 0.5 * 0.2, and 3 with nothing said of it.
    odds = np.array([0.1 / (0.5 * 0.2), 0.1])
    assert total(3, "selected") == pytest.approx([1, odds[0] / (0.5 + odds.sum()), 1])
    assert total(3, "printed") == pytest.approx([1, 1 / (1 - 0.1), 1])
    assert rows(3, "printed")["bin"].tolist() == [BEYOND]
    low, high = EDGES[rows(3, "selected")["bin"].iloc[0] - 1 :][:2]
    assert low <= odds[0] / (0.5 + odds.sum()) < high


def test_reliability_weighs_worlds_by_their_prior() -> None:
    row = {"cells": 4, "source": "model", "demonstrations": 1, "belief": "each"}
    made = [
        # truth, seed, prior, sets, set, bin, count, predicted, hits
        ("none", 0, 0.5, 2, 0, 5, 4, 0.2, 0),
        ("none", 1, 0.5, 3, 2, 5, 2, 0.1, 0),
        ("cell_0", 0, 0.25, 1, 0, 5, 2, 0.1, 1),
        ("cell_1", 0, 0.25, 1, 0, 12, 1, np.inf, 1),
    ]
    names = ["truth", "seed", "prior", "sets", "set", "bin", "count", "predicted", "hits"]
    table = pd.DataFrame(made, columns=names).assign(**row)
    opening = ["truth", "cells", "seed", "source", "prior", "sets", "set", "demonstrations"]
    found = reliability(table[[*opening, "belief", "bin", "count", "predicted", "hits"]])
    assert list(found.columns[:4]) == ["cells", "source", "demonstrations", "belief"]
    inside, beyond = found.to_dict("records")
    # None has five sets of weight 0.1, each cell one of weight 0.25.
    beliefs = 0.1 * 6 + 0.25 * 2
    assert inside["predicted"] == pytest.approx((0.1 * 0.3 + 0.25 * 0.1) / beliefs)
    assert inside["observed"] == pytest.approx(0.25 / beliefs)
    assert inside["weight"] == pytest.approx(beliefs / (beliefs + 0.25))
    assert (inside["lower"], inside["upper"]) == (EDGES[4], EDGES[5])
    assert (beyond["lower"], beyond["upper"]) == (1.0, np.inf)
    assert (beyond["observed"], beyond["low"], beyond["high"]) == (1.0, 1.0, 1.0)
    assert inside["count"] == 8
    # Of two worlds with a constraint, one is drawn twice in a quarter of the resamples.
    assert inside["low"] == 0.0
    assert inside["high"] == pytest.approx(2 * 0.25 / (0.1 * 4 + 0.25 * 4), rel=0.3)


def test_intervals_cover_what_other_worlds_give() -> None:
    rng = np.random.default_rng(0)
    worlds = np.repeat(np.arange(40), 4)
    hits = rng.random(160) < np.clip(rng.normal(0.3, 0.2, 40), 0, 1)[worlds]
    table = pd.DataFrame(
        {
            "truth": [f"cell_{world}" for world in worlds],
            "seed": 0,
            "source": "model",
            "prior": 0.01,
            "sets": 4,
            "set": np.tile(np.arange(4), 40),
            "demonstrations": 1,
            "belief": "selected",
            "bin": 7,
            "count": 1,
            "predicted": 0.3,
            "hits": hits.astype(int),
        }
    )
    (row,) = reliability(table).to_dict("records")
    by_world = hits.reshape(40, 4).mean(axis=1)
    spread = np.std(by_world) / np.sqrt(40)
    assert row["observed"] == pytest.approx(hits.mean())
    half = (row["high"] - row["low"]) / 2
    # Sets drawn anew in a world add their own spread to that of the worlds.
    assert 1.96 * spread < half < 1.96 * 1.6 * spread


def test_point_writes_the_table_when_asked(tmp_path: Path) -> None:
    words = ["scale=smoke", "safety.shape=[41,21]", "truth=cell", "truth.cell=3"]
    few = "calibration.demonstrations=[1,2]"
    settings = tiny(*words, few, "demonstrations.dt=0.05", "horizon=2.0")
    tables = run_point(settings, Store(tmp_path), lambda line: None)
    table, kept = tables["calibration"], len(tables["trials"])
    own = table[table["source"] == "demonstrator"]
    assert own["set"].nunique() == kept // 2
    assert set(table["source"]) == {"demonstrator", "model"}
    silent = dataclasses.replace(settings.calibration, sets=0)
    settings = dataclasses.replace(settings, calibration=silent)
    assert "calibration" not in run_point(settings, Store(tmp_path), lambda line: None)


def test_a_world_without_a_set_has_no_rows_but_all_columns(
    worlds: pd.DataFrame, tmp_path: Path
) -> None:
    settings = tiny("truth=none")
    settings = dataclasses.replace(
        settings, calibration=dataclasses.replace(settings.calibration, sets=0)
    )
    nothing = counts(settings, Store(tmp_path))
    assert nothing.empty
    assert list(nothing.columns) == [name for name in worlds if name not in ("truth", "seed")]


def test_model_that_solves_no_task_is_refused(tmp_path: Path) -> None:
    """In 0.5 s the mass gets from no cell to any other, and no task that is drawn stays in one."""
    stuck = ["horizon=0.5", "actions=1", "grid.shape=[3000,1]"]
    settings = tiny("truth=none", "calibration.sets=1", *stuck)
    with pytest.raises(RuntimeError, match="none of 1000 tasks can be solved by the tabular agent"):
        counts(settings, Store(tmp_path))


@pytest.mark.parametrize(
    ("probability", "place"),
    [(0.005, 2), (1.0, BEYOND - 1), (0.0, 1), (0.9, BEYOND - 1), (0.1, 6), (np.inf, BEYOND)],
)
def test_a_probability_that_is_an_edge_but_for_rounding_stays_in_its_bin(
    probability: float, place: int
) -> None:
    """The prior of one of 100 hypotheses is an edge, and so is a posterior that is printed as 1."""
    near = [probability, np.nextafter(probability, -1), np.nextafter(probability, 2)]
    near = np.array(near if np.isfinite(probability) else [probability] * 3)
    (row,) = _binned(near, np.zeros(3, bool))
    assert (row["bin"], row["count"]) == (place, 3)
    assert next(_binned(np.array([1 + 1e-6]), np.zeros(1, bool)))["bin"] == BEYOND
    assert next(_binned(np.array([-1e-6]), np.zeros(1, bool)))["bin"] == 0
