"""The tabular model as a stage: the same as computed directly, and computed once."""

import dataclasses
import logging
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hydra import compose, initialize_config_dir

from experiments.app import version_base
from experiments.config.paths import CONF
from experiments.config.read import plain_tree, read_config
from experiments.config.settings import Settings
from experiments.point import stages, trials
from experiments.point.run import run_point
from experiments.sweep.plugins import register_plugins
from experiments.tracking.store import Store
from mlci.grids import Grid
from mlci.safety.constant_controls import tabulate_escapes
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.simulate import EULER, RK4, rollout
from mlci.systems import Pendulum
from mlci.tabular import TabularModel, action_grid, discretize

register_plugins()


def composed(*overrides: str) -> Settings:
    with initialize_config_dir(str(CONF), **version_base()):
        return read_config(plain_tree(compose("config", ["grid.shape=[7,9]", *overrides])))[0]


def assert_equal(one: TabularModel, two: TabularModel) -> None:
    np.testing.assert_array_equal(one.action, two.action)
    one, two = one.kept, two.kept
    for name in ("successor", "reward"):
        assert getattr(one, name).dtype == getattr(two, name).dtype
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    assert one.crosses.dtype == two.crosses.dtype
    np.testing.assert_array_equal(one.crosses.toarray(), two.crosses.toarray())


@pytest.mark.parametrize(
    "overrides",
    [
        ["actions=3"],
        ["actions=3", "transition.samples=2", "temperature=0.5"],
        ["system=double_integrator", "truth=wall", "hypotheses.shape=[40,null]"],
    ],
)
def test_stored_model_is_the_computed_one(overrides: list[str], tmp_path: Path) -> None:
    settings = composed(*overrides)
    direct = discretize(
        settings.model,
        settings.cells,
        action_grid(settings.model, settings.action_counts),
        settings.dt,
        settings.candidates.joined(settings.constraint),
        settings.transition.samples,
        settings.temperature,
    )
    for _ in range(2):
        assert_equal(stages.tabular_model(settings, Store(tmp_path)), direct)


def test_model_is_computed_once_for_all_that_it_does_not_depend_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    counted: list[int] = []

    def counting(*arguments: object, **named: object) -> TabularModel:
        counted.append(len(arguments[4]))
        return discretize(*arguments, **named)

    monkeypatch.setattr(stages, "discretize", counting)
    settings = composed("actions=3")
    stages.tabular_model(settings, Store(tmp_path))
    assert counted == [100, 1]
    stages.tabular_model(dataclasses.replace(settings, seed=3, horizon=2.0), Store(tmp_path))
    stages.tabular_model(composed("actions=[3]"), Store(tmp_path))
    assert counted == [100, 1]
    stages.tabular_model(composed("actions=3", "truth=c2"), Store(tmp_path))
    assert counted == [100, 1, 1]
    for change in ("dt=0.5", "temperature=2.0", "transition.samples=2", "system.length=2.0"):
        counted.clear()
        stages.tabular_model(composed("actions=3", change), Store(tmp_path))
        assert counted == [100, 1], change


def test_nothing_forbidden_needs_no_safe_set_and_ranks_nothing(tmp_path: Path) -> None:
    settings = composed("truth=none", "inference=paper", "scale=smoke", "ranks.subsets=2", "dt=1.0")
    lines: list[str] = []
    tables = run_point(settings, Store(tmp_path), lines.append)
    assert lines[-1].strip() == "no region is forbidden, so there is no truth to rank"
    assert not any("nan" in line for line in lines)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "demonstrations",
        "mdp",
        "mdp_truth",
    ]
    assert tables["attempts"]["outcome"].isin(["kept", "goal_missed"]).all()
    assert tables["ranks"][["rank", "share_top_5"]].isna().all(axis=None)
    for name in ("hypotheses", "first"):
        assert not tables[name][["covered_by_truth", "overlaps_truth"]].any(axis=None)
    trials = tables["trials"]
    assert trials["truth_probability"].isna().all()
    assert trials["reachable"].equals(trials["feasible"])
    assert trials["final_state_error"].notna().any()


def test_choices_reach_the_demonstrator(tmp_path: Path) -> None:
    store = Store(tmp_path)
    words = ["safety.shape=[41,41]", "demonstrations.pairs=16", "demonstrations.keep=16"]
    words += ["demonstrations.dt=0.02", "demonstrations.restarts=1", "horizon=4.0"]
    plain = trials.demonstrations(composed(*words), store)
    kept = plain.kept(16)
    turned = np.abs(plain.states[kept, -1, 0] - plain.states[kept, 0, 0])
    assert np.max(np.abs(plain.controls[kept])) > 2.5
    assert np.max(turned) > np.pi + 0.1
    clipped = trials.demonstrations(composed(*words, "demonstrations.clip=true"), store)
    assert np.max(np.abs(clipped.controls)) <= 2.0
    direct = trials.demonstrations(composed(*words, "demonstrations.wind=false"), store)
    turned = np.abs(direct.states[:, -1, 0] - direct.states[:, 0, 0])[direct.kept(16)]
    assert np.max(turned) < np.pi + 0.05
    smooth = trials.demonstrations(composed(*words, "demonstrations.integrator=rk4"), store)
    for each, integrator in ((plain, EULER), (smooth, RK4)):
        step = integrator.step
        paths = rollout(Pendulum(), each.starts, each.controls, 0.02, step=step)
        np.testing.assert_allclose(each.states, paths, atol=1e-10)
    safe, _ = stages.safe_set(composed(*words), store)
    margin = border_margin(Pendulum(), safe, 0.02)
    for each, integrator in ((plain, EULER), (smooth, RK4)):
        # What a filter has let through once passes again, if it looks ahead by the same steps.
        once = SafetyFilter(Pendulum(), safe, 0.02, margin, integrator=integrator)
        again = once.apply(each.states[:, :-1], each.controls)
        np.testing.assert_array_equal(again, each.controls)
    careful = trials.demonstrations(composed(*words, "safety.margin=0.6"), store)
    assert np.min(safe.value(careful.starts)) >= 0.6
    assert np.min(safe.value(plain.starts)) < 0.6


def test_hypothesis_as_truth_gives_what_its_box_gives(tmp_path: Path) -> None:
    words = ["scale=smoke", "safety.shape=[41,41]", "demonstrations.pairs=4", "ranks.subsets=2"]
    words += ["demonstrations.keep=4"]
    box = "[{lower:['6/5 pi',-1.2],upper:['7/5 pi',0]}]"
    cell = composed("truth=cell", "truth.cell=64", *words)
    boxes = composed("truth=c1", f"truth.boxes={box}", *words)
    one, two = (run_point(each, Store(tmp_path), lambda line: None) for each in (cell, boxes))
    assert np.flatnonzero(one["hypotheses"]["covered_by_truth"]).tolist() == [64]
    for name, table in one.items():
        pd.testing.assert_frame_equal(table, two[name])


def test_damaged_model_is_computed_again(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    settings = composed("actions=3")
    before = stages.tabular_model(settings, Store(tmp_path))
    (entry,) = (tmp_path / "mdp").glob("*.npz")
    data = bytearray(entry.read_bytes())
    data[-200] ^= 1
    entry.write_bytes(data)
    with caplog.at_level(logging.WARNING):
        assert_equal(stages.tabular_model(settings, Store(tmp_path)), before)
    assert "damaged and is computed again" in caplog.text


def test_a_safe_set_from_constant_controls_lasts_for_the_horizon(tmp_path: Path) -> None:
    words = ["safety.method=escapes", "safety.shape=[9,9]"]
    made = []
    for horizon in (5.0, 0.5):
        settings = composed(*words, f"horizon={horizon}")
        grid, truth = Grid(settings.model.space, (9, 9)), settings.constraint
        safe, _ = stages.safe_set(settings, Store(tmp_path))
        direct = tabulate_escapes(settings.model, grid, truth, horizon=horizon)
        np.testing.assert_array_equal(safe.values, direct.values)
        made.append(safe.values)
    assert not np.array_equal(*made)
