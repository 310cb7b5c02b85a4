"""Points on disk, and tables that hold exactly what points wrote."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hydra import compose, initialize_config_dir

from experiments import attempt, run
from experiments import point as point_module
from experiments.config import read_config
from experiments.places import CONF
from experiments.record import Point
from experiments.settings import Settings
from experiments.store import Store, digest
from experiments.study import StudyError, read_study, write_plan
from experiments.tables import CollateError, collate
from experiments.task import plain_tree

run.register_plugins()

NUMBERS = np.array([1 / 3, 1e-300, np.nan, -0.1, 2**53 + 1.0])


@pytest.fixture(scope="module")
def settings() -> Settings:
    with initialize_config_dir(str(CONF), **run.VERSION_BASE):
        return read_config(plain_tree(compose("config")))[0]


@pytest.fixture(autouse=True)
def tiny_point(monkeypatch: pytest.MonkeyPatch) -> None:
    """Points that cost nothing."""

    def run_point(settings: Settings, store: Store, log) -> dict[str, pd.DataFrame]:
        log(f"dt is {settings.dt}")
        if settings.dt == 0.5:
            raise RuntimeError("half a second is too much")
        return {
            "trials": pd.DataFrame({"trial": range(5), "error": NUMBERS * settings.seed}),
            "attempts": pd.DataFrame({"truth": settings.truth.name, "cost": [1.5, settings.seed]}),
        }

    monkeypatch.setattr(point_module, "run_point", run_point)


def finished(settings: Settings, results: Path, **changes: object) -> Point:
    point = Point(dataclasses.replace(settings, **changes), results)
    attempt.run(point, print)
    return point


def test_finished_point_has_a_record_and_exact_tables(settings: Settings, tmp_path: Path) -> None:
    point = finished(settings, tmp_path, seed=1)
    assert point.is_done()
    table = pd.read_csv(point.folder / "trials.csv")
    assert list(table.columns[:5]) == ["truth", "cells", "actions", "dt", "samples"]
    assert table.iloc[0, :5].tolist() == ["c1", 400, 9, 0.25, 1]
    np.testing.assert_array_equal(table["error"], NUMBERS)
    record = json.loads((point.folder / "record.json").read_text())
    assert record["identity"] == point.folder.name
    assert record["config"]["grid"] == {"shape": [20, 20]}
    assert record["seconds"]["total"] >= 0
    assert record["packages"]["numpy"] == np.__version__
    assert (point.folder / "log.txt").read_text() == "dt is 0.25\n"


@pytest.mark.parametrize("harm", ["table", "record", "source", "missing"])
def test_point_that_is_not_whole_is_not_done(
    harm: str, settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    point = finished(settings, tmp_path)
    if harm == "table":
        (point.folder / "trials.csv").write_text("trial\n")
    elif harm == "record":
        (point.folder / "record.json").write_text('{"identity"')
    elif harm == "missing":
        (point.folder / "trials.csv").unlink()
    else:
        monkeypatch.setattr("experiments.record.source_hash", lambda modules: "edited")
    assert not Point(settings, tmp_path).is_done()


def test_point_that_fails_is_not_done_and_keeps_its_traceback(
    settings: Settings, tmp_path: Path
) -> None:
    with pytest.raises(RuntimeError, match="half a second"):
        finished(settings, tmp_path, dt=0.5)
    point = Point(dataclasses.replace(settings, dt=0.5), tmp_path)
    assert not point.is_done()
    log = (point.folder / "log.txt").read_text()
    assert log.startswith("dt is 0.5\nTraceback")
    assert "half a second is too much" in log


def test_collate_sorts_by_size_whatever_the_order(settings: Settings, tmp_path: Path) -> None:
    grids = [dataclasses.replace(settings.grid, shape=shape) for shape in [(40, 40), (20, 20)]]
    points = [finished(settings, tmp_path, grid=grid, dt=dt) for grid in grids for dt in [1.0, 0.1]]
    collate(points, tmp_path / "one")
    collate(points[::-1], tmp_path / "two")
    for name in ["trials.csv", "attempts.csv"]:
        one, two = (tmp_path / study / "tables" / name for study in ["one", "two"])
        assert one.read_bytes() == two.read_bytes()
    table = pd.read_csv(tmp_path / "one" / "tables" / "trials.csv")
    order = [(400, 0.1), (400, 1.0), (1600, 0.1), (1600, 1.0)]
    assert list(zip(table["cells"], table["dt"], strict=True)) == [
        pair for pair in order for _ in range(5)
    ]
    assert table["trial"].tolist() == list(range(5)) * 4
    # What depends on the truth alone stands once.
    assert len(pd.read_csv(tmp_path / "one" / "tables" / "attempts.csv")) == 2


def test_collate_adds_columns_that_tell_points_apart(settings: Settings, tmp_path: Path) -> None:
    flat = dataclasses.replace(settings.grid, shape=(10, 40))
    points = [
        finished(settings, tmp_path, seed=1),
        finished(settings, tmp_path, seed=0),
        finished(settings, tmp_path, seed=0, grid=flat),
    ]
    collate(points, tmp_path / "study")
    table = pd.read_csv(tmp_path / "study" / "tables" / "trials.csv")
    assert list(table.columns[:3]) == ["grid.shape", "seed", "truth"]
    assert table["grid.shape"].tolist() == ["[10, 40]"] * 5 + ["[20, 20]"] * 10
    assert table["seed"].tolist() == [0] * 10 + [1] * 5
    attempts = pd.read_csv(tmp_path / "study" / "tables" / "attempts.csv")
    assert list(attempts.columns) == ["seed", "truth", "cost"]
    assert attempts["seed"].tolist() == [0, 0, 1, 1]


def test_collate_refuses_an_unfinished_point(settings: Settings, tmp_path: Path) -> None:
    done, missing = finished(settings, tmp_path), Point(settings, tmp_path / "elsewhere")
    with pytest.raises(CollateError, match=f"point {missing.identity} is not finished"):
        collate([done, missing], tmp_path / "study")
    assert not (tmp_path / "study").exists()


def test_collate_refuses_a_mixture_of_sources(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = finished(settings, tmp_path)
    monkeypatch.setattr("experiments.record.source_hash", lambda modules: "edited")
    new = finished(settings, tmp_path, seed=1)
    with pytest.raises(CollateError, match="different versions of the source"):
        collate([old, new], tmp_path / "study")


def test_collate_refuses_other_columns(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = finished(settings, tmp_path)
    other = {"trials": pd.DataFrame({"trial": [1]}), "attempts": pd.DataFrame({"cost": [1]})}
    monkeypatch.setattr(point_module, "run_point", lambda *_: other)
    two = finished(settings, tmp_path, seed=1)
    with pytest.raises(CollateError, match=r"the columns of .*trials.csv are"):
        collate([one, two], tmp_path / "study")


def test_collate_mixes_sources_when_told_and_lists_them(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    points = [finished(settings, tmp_path, seed=seed) for seed in (0, 1)]
    monkeypatch.setattr("experiments.record.source_hash", lambda modules: "edited")
    points.append(finished(settings, tmp_path, seed=2))
    with pytest.raises(CollateError, match=rf"edited: 1 points, such as {points[2].identity}"):
        collate(points, tmp_path / "study")
    collate(points, tmp_path / "study", mixed=True)
    study = read_study(tmp_path / "study")
    assert study is not None
    assert study.collated is not None
    assert sorted(study.collated.sources.values()) == [1, 2]
    assert study.collated.sources["edited"] == 1


def test_refused_collate_leaves_all_old_tables(settings: Settings, tmp_path: Path) -> None:
    points = [finished(settings, tmp_path, seed=seed) for seed in (0, 1)]
    collate(points[:1], tmp_path / "study")
    before = {path: path.read_bytes() for path in (tmp_path / "study").rglob("*.*")}
    trials = points[1].folder / "trials.csv"
    trials.write_bytes(trials.read_bytes().replace(b"4", b"5", 1))
    with pytest.raises(CollateError, match=r"trials.csv is not as its point wrote it"):
        collate(points, tmp_path / "study")
    assert {path: path.read_bytes() for path in (tmp_path / "study").rglob("*.*")} == before


def test_listing_keeps_plan_and_tables_apart(settings: Settings, tmp_path: Path) -> None:
    points = [finished(settings, tmp_path, seed=seed) for seed in (1, 0)]
    folder = tmp_path / "study"
    write_plan(folder, [(point, [f"seed={point.settings.seed}"]) for point in points])
    planned = read_study(folder)
    assert planned is not None
    assert planned.points == {points[0].identity: ("seed=1",), points[1].identity: ("seed=0",)}
    assert planned.collated is None
    collate(points[::-1], folder)
    listing = (folder / "study.json").read_bytes()
    study = read_study(folder)
    assert study is not None
    assert study.points == planned.points
    assert study.collated is not None
    assert study.collated.points == (points[1].identity, points[0].identity)
    for name, was in study.collated.tables.items():
        assert digest((folder / "tables" / name).read_bytes()) == was
    assert study.collated.started[0] <= study.collated.started[1]
    # Another sweep that starts, and ends, in the same way.
    write_plan(folder, [(point, [f"seed={point.settings.seed}"]) for point in points])
    assert (folder / "study.json").read_bytes() == listing
    collate(points, folder)
    assert (folder / "study.json").read_bytes() == listing


def test_listing_that_is_broken_is_told_and_written_anew(
    settings: Settings, tmp_path: Path
) -> None:
    point = finished(settings, tmp_path)
    path = tmp_path / "study" / "study.json"
    path.parent.mkdir()
    for content in ("{", "[]", '{"points": []}', '{"points": {}, "collated": {"points": []}}'):
        path.write_text(content)
        with pytest.raises(StudyError, match=r"study.json cannot be read"):
            read_study(path.parent)
    collate([point], path.parent)
    study = read_study(path.parent)
    assert study is not None
    assert list(study.points) == [point.identity]
    assert read_study(tmp_path / "elsewhere") is None
