"""The stage of forecasts: what it shares, what it stores, and its table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tiny_point import TINY, composed

from experiments.config.read import read_config, read_recorded_config
from experiments.config.settings import RecordedSettings, Settings
from experiments.point import forecasts
from experiments.point.forecasts import forecast_calibration, forecast_table
from experiments.tracking.sealed import read_sealed, write_sealed
from experiments.tracking.store import Store
from mlci.calibration import Calibration, calibrate, calibrate_on
from mlci.demonstrations import Demonstration
from mlci.demonstrator import Outcome, demonstrate, sample_trials
from mlci.simulate import EULER
from mlci.tabular import action_grid, discretize


def settings_of(*words: str) -> Settings:
    return read_config(composed(*TINY, *words))[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("store")


@pytest.fixture(scope="module")
def calibration(folder: Path) -> Calibration:
    return forecast_calibration(settings_of(), Store(folder))


def test_it_is_that_of_the_library(calibration: Calibration) -> None:
    """With the demonstrator of the settings, whom nothing constrains, and a model without truth."""
    settings = settings_of()
    system = settings.model
    trials = sample_trials(
        system,
        None,
        settings.tasks.start_box(system.space),
        trials=200,
        seed=1 << 32,
        horizon=2.0,
        dt=0.05,
        restarts=1,
        hold=0.5,
    )
    attempts = demonstrate(system, trials, None, None, dt=0.05, integrator=EULER)
    paths = [each.demonstration for each in attempts if each.outcome is Outcome.KEPT]
    actions = action_grid(system, settings.action_counts)
    model = discretize(system, settings.cells, actions, 0.5, settings.candidates)
    expected = calibrate_on(model, paths, tried=200)
    assert (calibration.tried, calibration.used) == (200, expected.used)
    assert calibration.map == expected.map
    assert expected.after is not None
    assert calibration.after is not None
    assert calibration.after.brier == expected.after.brier
    assert calibration.after.bins.equals(expected.after.bins)
    assert calibration.out_of_reach == expected.out_of_reach


@pytest.mark.parametrize(
    "words",
    [
        "truth.boxes=[{lower: [1.0, null], upper: [2.0, null]}]",
        "seed=3",
        "demonstrations.keep=2",
        "reality.iterations=2",
    ],
)
def test_what_does_not_matter_is_shared(words: str, calibration: Calibration, folder: Path) -> None:
    store = Store(folder)
    entries = set(folder.glob("forecasts/*.npz"))
    again = forecast_calibration(settings_of(words), store)
    assert again.map == calibration.map
    assert set(folder.glob("forecasts/*.npz")) == entries


def test_too_few_demonstrations_are_stored_as_no_map(folder: Path) -> None:
    strict = settings_of("demonstrations.goal_tolerance=1e-12")
    for _ in range(2):  # computed, then read
        calibration = forecast_calibration(strict, Store(folder))
        assert calibration.map is None
        assert calibration.tried == 200
        assert forecast_table(calibration).empty


def test_the_table_has_both_forecasts(calibration: Calibration) -> None:
    table = forecast_table(calibration)
    assert calibration.before is not None
    assert calibration.after is not None
    for number, scores in ((0, calibration.before), (1, calibration.after)):
        rows = table[table["map"] == number]
        assert np.array_equal(rows["forecast"], scores.bins["forecast"])
        assert set(rows["brier_low"]) == {scores.brier.low}
        assert set(rows["off_by"]) == {scores.off_by}


def test_trials_are_none_of_the_studys() -> None:
    """A seed of settings is below 2^32."""
    assert forecasts.SEED == 2**32


def test_recordings_are_calibrated_by_tasks_like_theirs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = [word for word in TINY if word.split("=")[0] in ("dt", "actions", "grid.shape")]
    recorded = ["demonstrations=x", "system=double_integrator", "hypotheses.shape=[10,null]"]
    settings = read_recorded_config(composed(*recorded, *words, name="infer"))
    system = settings.model
    actions = action_grid(system, settings.action_counts)
    model = discretize(system, settings.cells, actions, settings.dt, settings.candidates)
    paths = [
        Demonstration.from_path(np.linspace([-1, 0], [end, 0], 201), 0.01) for end in (0.5, 1.0)
    ]
    store = Store(tmp_path)
    first = forecasts.recorded_calibration(settings, model, paths, store)
    assert first.map == calibrate(model, [path.task for path in paths]).map is not None

    def again(*_: object, **__: object) -> Calibration:
        raise AssertionError("it is stored")

    monkeypatch.setattr(forecasts, "calibrate", again)
    assert forecasts.recorded_calibration(settings, model, paths, store).map == first.map
    with pytest.raises(AssertionError, match="it is stored"):  # other tasks are not
        forecasts.recorded_calibration(settings, model, paths[:1], store)


@pytest.mark.parametrize("word", ["crossing.time=0.1", "inference.exact_ends=false"])
def test_another_way_to_infer_is_calibrated_anew(
    word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = [word for word in TINY if word.split("=")[0] in ("dt", "actions", "grid.shape")]
    words += ["demonstrations=x", "system=double_integrator", "hypotheses.shape=[10,null]"]
    made: list[object] = []

    def calibration_of(*_: object, **options: object) -> Calibration:
        made.append(options)
        return Calibration(200, 3)

    monkeypatch.setattr(forecasts, "calibrate", calibration_of)
    path = Demonstration.from_path(np.linspace([-1, 0], [1, 0], 201), 0.01)
    for changes in ([], [word], []):
        settings = read_recorded_config(composed(*words, *changes, name="infer"))
        forecasts.recorded_calibration(settings, None, [path], Store(tmp_path))
    assert len(made) == 2
    assert made[0] != made[1]


def recorded_settings(*words: str) -> RecordedSettings:
    """Of inference with the model of `settings_of()`."""
    model = ["demonstrations=x", "system=double_integrator", "actions=3", "grid.shape=[12,8]"]
    return read_recorded_config(composed(*model, *words, name="infer"))


@pytest.fixture
def exported(calibration: Calibration, folder: Path, tmp_path: Path) -> Store:
    """A copy of the calibration of `settings_of()`."""
    store = Store(folder)
    assert forecast_calibration(settings_of(), store).map == calibration.map is not None
    copy = Store(tmp_path / "calibration")
    assert store.copy("forecasts", store.keys["forecasts"], copy)
    return copy


@pytest.mark.parametrize(
    ("word", "fits"),
    [
        ("dt=0.5", True),
        ("inference.prior=0.2", True),
        ("dt=0.25", False),
        ("hypotheses.shape=[5,null]", False),
        ("inference.exact_ends=false", False),
        ("crossing.time=0.1", False),
    ],
)
def test_an_exported_calibration_is_used_where_it_fits(
    word: str, fits: bool, calibration: Calibration, exported: Store
) -> None:
    words = [word] if word.startswith("dt") else ["dt=0.5", word]
    found = forecasts.exported_calibration(recorded_settings(*words), exported)
    assert (found is not None) == fits
    assert found is None or found.map == calibration.map


@pytest.mark.parametrize(
    "change", [{"source": "another"}, {"depends": 3}, {"depends": []}, {"depends": {"a": 1}}]
)
def test_an_exported_calibration_of_another_make_is_not_used(
    change: dict[str, object], exported: Store
) -> None:
    settings = recorded_settings("dt=0.5")
    assert forecasts.exported_calibration(settings, exported) is not None
    (note,) = exported.folder.glob("forecasts/*.json")
    write_sealed(note, {**read_sealed(note), **change})
    assert forecasts.exported_calibration(settings, exported) is None
