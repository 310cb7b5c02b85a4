"""The tabular model as a stage: the same as computed directly, and computed once."""

import dataclasses
import logging
from pathlib import Path

import numpy as np
import pytest
from hydra import compose, initialize_config_dir

from experiments import run, stages
from experiments.config import read_config
from experiments.places import CONF
from experiments.settings import Settings
from experiments.store import Store
from experiments.task import plain_tree
from mlci.mdp import TabularMDP, action_grid, discretize

run.register_plugins()


def composed(*overrides: str) -> Settings:
    with initialize_config_dir(str(CONF), **run.VERSION_BASE):
        return read_config(plain_tree(compose("config", ["grid.shape=[7,9]", *overrides])))[0]


def assert_equal(one: TabularMDP, two: TabularMDP) -> None:
    for name in ("successor", "reward", "allowed", "action"):
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
        action_grid(settings.model, list(settings.action_counts)),
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

    def counting(*arguments: object, **named: object) -> TabularMDP:
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
