"""The first step of a point: what it hands to the others."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from experiments.config.settings import Settings
from experiments.point.forecasts import forecast_calibration
from experiments.point.inference import infer_point
from experiments.tracking.store import Store
from mlci.calibration import Calibration
from mlci.evidence import Rates
from mlci.preparation import infer


def test_settings_reach_the_inference(settings: Settings, tmp_path: Path) -> None:
    changed = dataclasses.replace(
        settings.inference, prior=0.3, exact_ends=False, model_error=0.2, rule_breaking=0.05
    )
    point = infer_point(dataclasses.replace(settings, inference=changed), Store(tmp_path))
    assert point.inference.prior_none == 0.3
    assert point.inference.rates == Rates(model_error=0.2, rule_breaking=0.05)
    assert point.inference.hypotheses.names == settings.candidates.names
    assert [name for name, true in zip(point.model.regions.names, point.truth, strict=True) if true]
    assert not np.any(point.truth & point.hypotheses)
    assert np.all(point.truth | point.hypotheses)
    guess = dataclasses.replace(settings.inference, rule_breaking="estimate")
    guessed = infer_point(dataclasses.replace(settings, inference=guess), Store(tmp_path)).inference
    assert guessed.rule_breaking is not None
    assert guessed.rates.rule_breaking == guessed.rule_breaking.rate
    assert guessed.of([0]).rule_breaking == guessed.of([0]).with_rule_breaking().rule_breaking
    again, exact = (
        infer(point.model, point.demonstrations, hypotheses=point.hypotheses, exact_ends=ends)
        for ends in (False, True)
    )
    np.testing.assert_array_equal(again.phi, point.inference.phi)
    with_defaults = infer_point(settings, Store(tmp_path)).inference
    np.testing.assert_array_equal(exact.evidence, with_defaults.evidence)
    assert not np.array_equal(exact.phi, again.phi)
    trials = point.trials
    for number, demonstration in zip(point.numbers, point.demonstrations, strict=True):
        assert trials.outcome[number] == "kept"
        np.testing.assert_array_equal(demonstration.states, trials.states[number])
        np.testing.assert_array_equal(demonstration.task.start, trials.starts[number])
        np.testing.assert_array_equal(demonstration.task.goal.upper, trials.goal_upper[number])
        assert demonstration.task.horizon == settings.horizon
    assert point.unreachable == np.sum(~point.inference.reachable)


def test_evidence_is_calibrated_where_it_can_be(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = dataclasses.replace(settings.inference, calibrate=True)
    more = dataclasses.replace(settings.demonstrations, keep=5)  # some of which say something
    settings = dataclasses.replace(settings, inference=asked, demonstrations=more)
    store = Store(tmp_path)
    point = infer_point(settings, store)
    assert point.inference.calibration == forecast_calibration(settings, store).map is not None
    assert point.inference.rates.model_error == 0
    plain = dataclasses.replace(settings, inference=dataclasses.replace(asked, calibrate=False))
    uncalibrated = infer_point(plain, store).inference
    np.testing.assert_array_equal(point.inference.avoidance, uncalibrated.avoidance)
    assert not np.allclose(point.inference.evidence, uncalibrated.evidence)
    monkeypatch.setattr(
        "experiments.point.inference.forecast_calibration", lambda *_: Calibration(200, 3)
    )
    hopeless = infer_point(settings, store)
    assert "not calibrated" in hopeless.calibration.summary()
    np.testing.assert_array_equal(hopeless.inference.evidence, uncalibrated.evidence)
