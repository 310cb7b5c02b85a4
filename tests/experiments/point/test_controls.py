"""Ranges of controls of tiny points: limited demonstrators, tables, calibration and stages."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tiny_point import TINY, composed, computed

from experiments.collate.intervals import control_curve, joint_curve
from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.point import controls, trials
from experiments.point.inference import infer_point
from experiments.point.joint import true_pairs
from experiments.point.keep_out import keep_out
from experiments.point.stages import safe_set
from experiments.tracking.store import Store
from experiments.tracking.trees import canonical_json
from mlci.evidence import Rates
from mlci.forecasts import ForecastCurve, ForecastMap
from mlci.simulate import RK4

# The cart pushes no harder than 0.4 m/s^2, of 1.
WEAK = ("truth=none", "truth.name=weak", "truth.controls=[{lower: [0.4], upper: [null]}]")
ASKED = ("system=double_integrator", "hypotheses.controls.shares=[0.4,0.8]", "actions=6")
TASKS = ("demonstrations.pairs=12", "demonstrations.keep=8", "tasks.upper=[null,0.5]")


def settings_of(*words: str) -> Settings:
    return read_config(composed(*TINY[1:], *ASKED, *TASKS, *words))[0]


def test_demonstrators_keep_to_the_limit_and_rule_breakers_do_not(tmp_path: Path) -> None:
    limited, free, broken = (
        trials.demonstrations(settings_of(*words), Store(tmp_path))
        for words in (WEAK, ("truth=none",), (*WEAK, "demonstrations.rule_breaking=0.5"))
    )
    assert np.max(free.controls) > 0.6
    assert np.max(limited.controls) == 0.4  # clipped to it, and not beyond
    assert np.min(limited.controls) < -0.6
    np.testing.assert_array_equal(limited.starts, free.starts)
    breaks = broken.rule_breaking
    assert 0 < breaks.sum() < len(breaks)
    np.testing.assert_array_equal(broken.controls[breaks], free.controls[breaks])
    np.testing.assert_array_equal(broken.controls[~breaks], limited.controls[~breaks])


def test_who_is_limited_and_keeps_out_of_a_region_does_both(tmp_path: Path) -> None:
    """The wall from 0.6 m to 1.2 m, and no push above 0.4 m/s^2. Who comes from the right, 0.8 m
    before it and at 1 m/s, brakes by a push: 0.5 m with 1 m/s^2, and 1.25 m with the limit."""
    both = settings_of("truth=wall", "truth.name=both", WEAK[2])
    weak = trials.demonstrations(both, Store(tmp_path))
    wall = trials.demonstrations(settings_of("truth=wall"), Store(tmp_path))
    kept = weak.kept(12)
    assert len(kept)
    assert np.max(weak.controls[kept]) <= 0.4 + 1e-9
    assert np.max(wall.controls) > 0.6
    entered = both.constraint.violated_by(weak.states[kept].reshape(-1, 2)[:, None])
    assert not entered.any()
    (limited, one), (free, other) = (
        safe_set(each, Store(tmp_path)) for each in (both, settings_of("truth=wall"))
    )
    assert one != other
    coming = np.array([[2.0, -1.0], [-0.2, 1.0]])  # from the right, and from the left
    assert (free.value(coming) > 0).tolist() == [True, True]
    assert (limited.value(coming) > 0).tolist() == [False, True]
    at_the_border = np.array([[1.66, -0.6]])  # of what 0.4 m/s^2 can brake: 0.45 m before it
    towards = np.array([[-1.0]])
    pushed = keep_out(both, Store(tmp_path), RK4).filter.apply(at_the_border, towards)
    np.testing.assert_allclose(pushed, 0.4)


def test_pairs_of_a_point(tmp_path: Path) -> None:
    words = ("truth=wall", "truth.name=both", WEAK[2], "hypotheses.controls.both=0.3")
    point = computed(settings_of(*words), tmp_path)
    pairs = pd.read_csv(point.folder / "joint.csv")
    assert len(pairs) == 11 * 5  # ten slices and none, four ranges and none
    assert pairs["posterior"].sum() == pytest.approx(1)
    truth = pairs[pairs["is_truth"]]
    assert truth["controls"].tolist() == ["control 1 above 0.4"]
    assert truth["region"].tolist() == ["6"]
    ranks = pd.read_csv(point.folder / "joint_ranks.csv")
    kinds = ranks[["of_nothing", "of_region", "of_controls", "of_both"]]
    np.testing.assert_allclose(kinds.sum(axis=1), 1)
    first = (ranks["first_region"] == "6") & (ranks["first_controls"] == "control 1 above 0.4")
    np.testing.assert_array_equal(ranks["true_first"], first)
    curve = joint_curve(ranks.astype({"truth": str}))
    assert curve["posterior"].iloc[-1] == pytest.approx(
        ranks.loc[ranks["demonstrations"] == 2, "posterior"].mean()
    )
    log = " ".join((point.folder / "log.txt").read_text().split())
    assert "a region and controls in one belief; forbidden are: nothing" in log


def test_true_pairs_where_one_thing_or_nothing_is_forbidden() -> None:
    regions = np.arange(10) == 6
    free, limited = settings_of("truth=none"), settings_of(*WEAK)
    wall = settings_of("truth=wall")
    for settings, expected in ((free, (10, 4)), (limited, (10, 0)), (wall, (6, 4))):
        assert np.argwhere(true_pairs(settings, regions)).tolist() == [list(expected)]


def test_truth_of_controls_counts_for_demonstrations_alone() -> None:
    one, other = settings_of(*WEAK), settings_of(*WEAK[:2], WEAK[2].replace("0.4", "0.5"))
    inputs = [canonical_json(trials.demonstration_inputs(each, None)) for each in (one, other)]
    assert inputs[0] != inputs[1]


def test_tables_of_a_point(tmp_path: Path) -> None:
    point = computed(settings_of(*WEAK), tmp_path)
    ranked = pd.read_csv(point.folder / "controls.csv")
    assert ranked["is_truth"].sum() == 1
    assert ranked.loc[ranked["in_truth"], "name"].tolist() == [
        "control 1 above 0.4",
        "control 1 above 0.8",
    ]
    assert ranked["applied_by"].iloc[0] == 0
    assert ranked.loc[ranked["gain"] == -np.inf, "posterior"].eq(0).all()
    ranks = pd.read_csv(point.folder / "control_ranks.csv")
    assert len(ranks) == 2 * 3  # sizes of subsets, subsets; one kind of evidence
    assert ranks["calibrated"].eq(0).all()
    both = ranks["demonstrations"] == 2
    np.testing.assert_allclose(ranks.loc[both, "true_first"], ranks.loc[both, "rank"] == 1)
    assert ranks["posterior"].between(0, 1).all()
    assert not (ranks["wrong_sure"] & ~ranks["wrong"]).any()
    curve = control_curve(ranks.astype({"truth": str}))
    assert curve["demonstrations"].tolist() == [1, 2]
    assert curve["posterior"].iloc[0] == pytest.approx(ranks.loc[~both, "posterior"].mean())
    log = (point.folder / "log.txt").read_text()
    assert "controls" in log
    assert "at most one range is forbidden" in " ".join(log.split())


def test_wrong_answers_where_nothing_is_forbidden(tmp_path: Path) -> None:
    point = infer_point(settings_of("truth=none"), Store(tmp_path))
    assert point.beliefs.controls is not None
    never = dataclasses.replace(
        point.beliefs.controls, applied=np.zeros_like(point.beliefs.controls.applied)
    )
    settings, rng = settings_of("truth=none"), np.random.default_rng(0)
    ranks = controls.control_tables(settings, never, rng)["control_ranks"]
    assert ranks.loc[ranks["demonstrations"] == 2, "wrong"].eq(1).all()
    assert ranks["rank"].isna().all()
    assert ranks["true_first"].isna().all()
    always = dataclasses.replace(never, applied=~never.applied)
    ranks = controls.control_tables(settings, always, rng)["control_ranks"]
    assert ranks["wrong"].eq(0).all()
    assert ranks["first"].eq("").all()
    assert ranks["none"].eq(1).all()


def test_ranks_of_controls_by_hand(tmp_path: Path) -> None:
    """All demonstrations say the same: the truth comes after a range that is no part of it."""
    settings = settings_of(*WEAK)
    inferred = infer_point(settings, Store(tmp_path)).beliefs.controls
    assert inferred is not None
    names = inferred.hypotheses.names
    alpha = {"control 1 above 0.4": 0.02, "control 1 below -0.4": 0.0}
    same = np.tile([alpha.get(name, 1.0) for name in names], (len(inferred.names), 1))
    known = dataclasses.replace(inferred, avoidance=same, applied=np.zeros_like(inferred.applied))
    ranks = controls.control_tables(settings, known, np.random.default_rng(0))["control_ranks"]
    one = ranks[ranks["demonstrations"] == 1]
    error = settings.inference.model_error
    of_truth, of_first = ((1 / ((1 - error) * a + error)) / 4 for a in (0.02, 0.0))
    total = 1 + of_truth + of_first + 2 / 4  # as probable as nothing, all ranges together
    assert one["first"].eq("control 1 below -0.4").all()
    assert one["rank"].eq(2).all()
    np.testing.assert_allclose(one["posterior"], of_truth / total)
    np.testing.assert_allclose(one["none"], 1 / total)
    assert of_first / total < 0.5
    assert one[["true_first", "wrong", "wrong_sure"]].eq([0, 1, 0]).all(axis=None)
    level = ForecastMap((ForecastCurve((1e-6, 1.0), 9, 99, 0.0, 0.0, 0.0, ceiling=0.6),))
    mapped = dataclasses.replace(known, calibration=level, rates=Rates(0.0))
    both = controls.control_tables(settings, mapped, np.random.default_rng(0))["control_ranks"]
    plain = both[both["calibrated"] == 0].reset_index(drop=True)
    pd.testing.assert_frame_equal(plain, ranks)  # with the model error, as without a map


def test_chances_are_calibrated_by_demonstrators_whom_nothing_limits(tmp_path: Path) -> None:
    store, settings = Store(tmp_path), settings_of(*WEAK, "inference.calibrate=true")
    inferred = infer_point(settings, store).beliefs.controls
    assert inferred is not None
    assert inferred.calibration is not None
    assert inferred.rates.model_error == 0  # the map has what takes its place
    other = settings_of("truth=none", "inference.calibrate=true")
    assert infer_point(other, store).beliefs.controls.calibration == inferred.calibration  # stored
    tables = controls.control_tables(settings, inferred, np.random.default_rng(0))
    plain, mapped = (part for _, part in tables["control_ranks"].groupby("calibrated"))
    assert mapped["none"].mean() > plain["none"].mean()  # so coarse a model says too much
