"""Worlds of arms: a truth that is drawn, and demonstrators whom a barrier keeps out of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tiny_point import composed, computed

from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.point import trials, truth_draw
from experiments.point.no_answer import NoAnswer
from experiments.point.truth_draw import with_truth
from experiments.tracking.store import Store
from mlci.demonstrator import demonstrate, sample_trials

WORLD = (
    "experiment=arms",
    "system=arm2",
    "hypotheses.shape=[4,4,null,null]",
    "hypotheses.grids=[[null,5,null,null]]",
    "demonstrations.pairs=3",
    "demonstrations.keep=2",
    "demonstrations.dt=0.05",
    "sampled.samples=300",
    "sampled.restarts=1",
)


@pytest.fixture(scope="module")
def settings() -> Settings:
    return read_config(composed(*WORLD))[0]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return Store(tmp_path_factory.mktemp("store"))


def test_hypotheses_of_several_grids_follow_each_other(settings: Settings) -> None:
    regions = settings.candidates
    assert len(regions) == settings.hypotheses.number == 21
    assert np.isinf(regions.lower[16:, 0]).all()
    np.testing.assert_allclose(regions.upper[16:, 1] - regions.lower[16:, 1], 0.5)
    np.testing.assert_allclose(regions.upper[:16, 1] - regions.lower[:16, 1], 2.5 / 4)


def test_the_truth_is_crossed_by_the_seeds_tasks(settings: Settings, store: Store) -> None:
    """Counted here with samples alone, at ten times as many of them as a hold has."""
    number = with_truth(settings, store).truth.number
    assert number is not None
    truth, task = settings.candidates.box(number), settings.tasks
    drawn = sample_trials(
        settings.model,
        None,
        task.start_box(settings.model.space),
        trials=60,
        seed=settings.seed,
        horizon=1.0,
        dt=0.05,
        goal_offsets=task.goal_offsets,
        restarts=1,
    )
    attempts = demonstrate(settings.model, drawn, None, None, dt=0.05, iterations=20)
    paths = np.array([e.demonstration.states for e in attempts if e.outcome.value == "kept"])
    fine = np.linspace(paths[:, :-1], paths[:, 1:], 11, axis=2).reshape(len(paths), -1, 4)
    inside = np.all((fine > truth.lower) & (fine < truth.upper), axis=-1)
    ends = inside[:, 0] | inside[:, -1]
    assert np.sum(inside.any(axis=1) & ~ends) >= 10
    assert with_truth(replace(settings, seed=1), store).truth.number != number


def test_a_truth_that_is_given_stays(store: Store) -> None:
    given = read_config(composed("truth=cell", "truth.cell=3"))[0]
    assert with_truth(given, store) is given


def test_without_crossings_there_is_no_truth(
    settings: Settings, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = replace(settings, seed=7)
    monkeypatch.setattr(truth_draw, "_TASKS", 1)
    short = replace(
        other, tasks=replace(settings.tasks, lower=(0.5, 0.5, 0, 0), upper=(0.5, 0.5, 0, 0))
    )
    with pytest.raises(NoAnswer, match="none of 1 tasks crosses a hypothesis between ends outside"):
        with_truth(short, store)


def test_a_barrier_keeps_demonstrators_out(settings: Settings, store: Store) -> None:
    """Their optima, were there no truth, enter it; and there is no safe set to be stored."""
    world = with_truth(settings, store)
    kept = trials.demonstrations(world, store)
    numbers = kept.kept(3)
    assert len(numbers) >= 1
    assert "safe_set" not in store.keys
    truth = world.constraint
    fine = np.linspace(kept.states[numbers, :-1], kept.states[numbers, 1:], 11, axis=2)
    assert np.all(truth.signed_distance(fine.reshape(-1, 4)) >= 0)


def test_a_world_is_a_point_with_its_tables(tmp_path: Path, settings: Settings) -> None:
    point = computed(settings, tmp_path)
    tables = {path.stem: pd.read_csv(path) for path in point.folder.glob("*.csv")}
    (row,) = tables["models"].to_dict("records")
    assert row["truth"] == "drawn"
    (truth,) = tables["hypotheses"].query("covered_by_truth").to_dict("records")
    assert row["posterior"] == pytest.approx(truth["posterior"])
    assert row["claim"] == pytest.approx(tables["hypotheses"]["posterior"].max())
    scored = tables["scored"]
    assert np.all((scored["lower"] <= scored["forecast"]) & (scored["forecast"] <= scored["upper"]))
    assert 0 < scored["count"].sum() <= row["possible"] * 21
