"""Studies and points of a folder, by their names."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
import pytest
from hand_made import hand_made

from experiments.collate.join import collate
from experiments.lookback.archive import Archive, ArchiveError, Facts, value_of
from experiments.tracking.points import Point, State
from experiments.tracking.study import Study, write_plan


@pytest.fixture
def points(tmp_path: Path) -> list[Point]:
    """Two points of the study `some`, and one that is planned alone."""
    points = [hand_made(tmp_path, seed=seed) for seed in (0, 1)]
    points.append(Point.planned({"seed": 2}, tmp_path))
    write_plan(tmp_path / "some", [(point, ["any"]) for point in points])
    return points


def identity_of(item: Study | Facts) -> str:
    assert isinstance(item, Facts)
    return item.point.identity


def test_points_are_found_by_the_beginning_of_their_identity(
    points: list[Point], tmp_path: Path
) -> None:
    archive = Archive(tmp_path)
    assert list(archive.points) == sorted(point.identity for point in points[:2])
    for point in points:  # the last has no folder
        assert identity_of(archive.find(point.identity)) == point.identity
        assert identity_of(archive.find(point.identity[:20])) == point.identity
    states = [facts.state for facts in archive.points_of(archive.study("some"))]
    assert states == [State.DONE, State.DONE, State.MISSING]


def test_a_name_that_fits_several_or_nothing_is_refused(
    points: list[Point], tmp_path: Path
) -> None:
    names = [f"abc{number:029}" for number in (1, 2)]
    for name in names:
        (tmp_path / "points" / name).mkdir()
    archive = Archive(tmp_path)
    with pytest.raises(ArchiveError, match="abc: 2 points begin so, such as abc00000000, abc"):
        archive.find("abc")
    with pytest.raises(ArchiveError, match=r"soem: no such study or point; did you mean some\?"):
        archive.find("soem")
    with pytest.raises(ArchiveError, match=f"{points[0].identity}: no such study; known are some"):
        archive.study(points[0].identity)
    assert archive.find(str(tmp_path / "points" / points[0].identity)) is archive.find(
        points[0].identity
    )
    with pytest.raises(ArchiveError, match="other/points/abc: no such study or point"):
        archive.find("other/points/abc")


def test_an_empty_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(ArchiveError, match="holds no results; run a sweep first"):
        Archive(tmp_path).find("some")


def test_a_study_that_cannot_be_read_is_told(points: list[Point], tmp_path: Path) -> None:
    (tmp_path / "some" / "study.json").write_text("{")
    archive = Archive(tmp_path)
    assert archive.studies == {}
    (reason,) = archive.unreadable
    with pytest.raises(ArchiveError) as error:
        archive.find("some")
    assert str(error.value) == reason


def test_facts_of_a_finished_point(points: list[Point]) -> None:
    facts = Facts(points[1])
    assert facts.config["grid.shape"] == "[4, 3]"
    assert facts.summary["seed"] == 1
    assert facts.summary["dt"] == 0.5
    assert facts.summary["truth"] == "wall"
    (points[1].folder / "summary.csv").write_text("truth\n")
    assert Facts(points[1]).summary == Facts(points[1]).config == {}


@pytest.mark.parametrize(
    ("text", "value"),
    [("4", 4), ("0.25", 0.25), ("1e-3", 1e-3), ("true", True), ("null", None), ("c1", "c1")],
)
def test_values_are_read_as_yaml_spells_them(text: str, value: object) -> None:
    assert value_of(text) == value
    assert type(value_of(text)) is type(value)


def test_points_are_shipped_where_some_table_of_theirs_is_there(tmp_path: Path) -> None:
    tables = {"trials": pd.DataFrame({"trial": [0], "error": [0.5]})}
    point = hand_made(tmp_path, tables)
    write_plan(tmp_path / "some", [(point, ["any"])])
    collate([point], tmp_path / "some")
    shutil.rmtree(tmp_path / "points")
    assert Archive(tmp_path).point(point.identity).state is State.SHIPPED
    (tmp_path / "some" / "tables" / "trials.csv").unlink()
    assert Archive(tmp_path).point(point.identity).state is State.SHIPPED
    for path in (tmp_path / "some" / "tables").iterdir():
        path.unlink()
    assert Archive(tmp_path).point(point.identity).state is State.MISSING
