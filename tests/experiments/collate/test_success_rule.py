"""The rule of a made-up study: one number tells of success, in all systems but for noise."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from dynamics_study import dynamics

from experiments.collate.success_rule import success_tables


@pytest.fixture(scope="module")
def made() -> dict[str, pd.DataFrame]:
    return success_tables(dynamics())


def test_the_rule_adds_the_number_that_decides_to_expected_violations(made) -> None:
    rule = made["success_rule"]
    assert rule["feature"].tolist()[:2] == ["expected_violations", "reach"]
    assert rule["feature"].iloc[-1] == "intercept"
    assert len(rule) <= 4
    first = rule.iloc[1]
    assert 0 < first["weight_low"] < first["weight"] < first["weight_high"]
    table = dynamics()["reach"]
    assert (first["least"], first["most"]) == (table.min(), table.max())


def test_the_scores_are_means_of_squared_differences(made) -> None:
    forecasts, scores = made["success_forecasts"], made["success_scores"].set_index("way")
    y = forecasts["top"]
    for way in scores.index:
        expected = ((forecasts[way] - y) ** 2 + y * (1 - y)).mean()
        assert scores.loc[way, "brier"] == pytest.approx(expected, abs=1e-12)
        assert scores.loc[way, "brier_low"] <= expected <= scores.loc[way, "brier_high"]
    less = scores.loc["rule", "brier"] - scores.loc["base_rate", "brier"]
    assert scores.loc["base_rate", "rule_less"] == pytest.approx(less, abs=1e-12)
    # `expected_violations` tells nothing here, and `reach` much.
    assert scores.loc["base_rate", "rule_less_high"] < 0
    assert scores.loc["expected_violations", "rule_less_high"] < 0


def test_the_base_rate_of_a_system_is_that_of_the_others(made) -> None:
    forecasts = made["success_forecasts"]
    for system, rows in forecasts.groupby("system"):
        others = forecasts.loc[forecasts["system"] != system, "top"].mean()
        np.testing.assert_allclose(rows["base_rate"], others, atol=1e-6)


def test_means_are_of_each_system_grid_and_time_step(made) -> None:
    systems = made["success_systems"]
    assert len(systems) == 10
    assert set(systems["points"]) == {4}
    assert set(systems["over_claim"]) == {0.25}
    assert set(systems["violation_distance"]) == {2.0}
    one = dynamics().query("system == 'S0' and cells == 400")["top"]
    row = systems.query("system == 'S0' and cells == 400").iloc[0]
    assert row["top"] == pytest.approx(one.mean())
    assert row["top_low"] <= row["top"] <= row["top_high"]


def test_two_systems_have_no_third_to_choose_features_by() -> None:
    forecasts = success_tables(dynamics(2))["success_forecasts"]
    np.testing.assert_allclose(forecasts["rule"], forecasts["expected_violations"])
    assert set(success_tables(dynamics(1))) == {"success_systems"}
