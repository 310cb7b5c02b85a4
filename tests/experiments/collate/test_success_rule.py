"""The rule of a made-up study: one number tells of success, in all systems but for noise."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from dynamics_study import dynamics

from experiments.collate.intervals import TAILS
from experiments.collate.success_rule import success_scores, success_tables
from mlci.outlook.rule import fit_rule


@pytest.fixture(scope="module")
def made() -> dict[str, pd.DataFrame]:
    return success_tables(dynamics())


def test_the_rule_adds_the_number_that_decides_to_simulated_success(made) -> None:
    rule = made["success_rule"]
    assert rule["feature"].tolist()[:2] == ["simulated", "reach"]
    assert rule["feature"].iloc[-1] == "intercept"
    assert len(rule) <= 4
    first = rule.iloc[1]
    assert 0 < first["weight_low"] < first["weight"] < first["weight_high"]
    table = dynamics()["reach"]
    assert (first["least"], first["most"]) == (table.min(), table.max())


def test_limits_of_weights_are_those_of_rules_of_resampled_systems(made) -> None:
    """Each rule is read off from what it foretells at the mean and a standard deviation beside."""
    table, rule = dynamics(), made["success_rule"]
    names, number = rule["feature"][:-1].tolist(), np.arange(40).reshape(5, 8)
    features, top = table[names].to_numpy(), table["top"].to_numpy()
    mean, scale = (rule[column][:-1].to_numpy() for column in ("mean", "scale"))
    places = np.vstack([mean + np.diag(scale), mean])
    rng, found = np.random.default_rng(1), []
    for _ in range(200):
        drawn = number[rng.integers(5, size=5)].ravel()
        p = fit_rule(features[drawn], top[drawn]).probability(places)
        log_odds = np.log(p / (1 - p))
        found.append([*(log_odds[:-1] - log_odds[-1]), log_odds[-1]])
    spread = np.std(found, axis=0)
    for column, limit in zip(
        ("weight_low", "weight_high"), np.quantile(found, TAILS, axis=0), strict=True
    ):
        np.testing.assert_array_less(np.abs(rule[column] - limit), 0.7 * spread)


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


def test_scores_do_not_depend_on_the_order_of_systems(made) -> None:
    forecasts = made["success_forecasts"]
    blocks = [forecasts[forecasts["system"] == f"S{k}"] for k in (3, 0, 4, 1, 2)]
    larger = pd.concat([*blocks, blocks[0]])  # one system has more points
    in_order = larger.sort_values("system", kind="stable")
    pd.testing.assert_frame_equal(success_scores(larger), success_scores(in_order))


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
    for column in ("violation_distance", "violation_distance_low", "violation_distance_high"):
        assert set(systems[column]) == {2.0}  # of those points that have one
    one = dynamics().query("system == 'S0' and cells == 400")["top"]
    row = systems.query("system == 'S0' and cells == 400").iloc[0]
    assert row["top"] == pytest.approx(one.mean())
    assert row["top_low"] <= row["top"] <= row["top_high"]


def test_points_of_which_a_feature_is_not_known_have_no_part() -> None:
    table = dynamics(2)
    table.loc[3, "reach"] = np.nan
    made = success_tables(table)
    assert made["success_systems"]["points"].sum() == 16
    assert "cell_3" not in set(made["success_forecasts"]["truth"])
    assert len(made["success_forecasts"]) == 15


def test_two_systems_have_no_third_to_choose_features_by() -> None:
    forecasts = success_tables(dynamics(2))["success_forecasts"]
    assert not np.allclose(forecasts["rule"], forecasts["base_rate"])  # `simulated` in any case
    assert set(success_tables(dynamics(1))) == {"success_systems"}
