"""Tables of a study hold exactly what points wrote, in an order that is theirs alone."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hand_made import alter, hand_made

from experiments.collate.finished import CollateError, FinishedPoint
from experiments.collate.join import _opened, collate
from experiments.tracking.files import digest
from experiments.tracking.points import Point
from experiments.tracking.sealed import read_sealed
from experiments.tracking.study import Study, read_study, write_plan

NUMBERS = [1 / 3, 1e-300, 5e-324, -0.1, -0.0, 2**53 + 1.0, np.nextafter(1, 2), np.inf, np.nan]


def trials(*errors: float) -> dict[str, pd.DataFrame]:
    return {"trials": pd.DataFrame({"trial": range(len(errors)), "error": errors})}


def point_with(results: Path, *errors: float, **values: Any) -> Point:
    return hand_made(results, trials(*errors) if errors else trials(0.5, 0.25), **values)


def rows_of(points: Sequence[Point], name: str = "trials") -> list[str]:
    """The rows of the points' own tables, one point after the other."""
    texts = [(point.folder / f"{name}.csv").read_text() for point in points]
    return [row for text in texts for row in text.splitlines()[1:]]


def lines(folder: Path, name: str = "trials") -> list[str]:
    """The lines of a study's table."""
    return (folder / "tables" / f"{name}.csv").read_text().splitlines()


def study_of(folder: Path) -> Study:
    study = read_study(folder)
    assert study is not None
    return study


def test_values_are_copied_as_they_are_spelt(tmp_path: Path) -> None:
    words = ["a, b", 'say "x"', "", "nan", "NA", "1e-5", "True", "007", " "]
    table = pd.DataFrame({"trial": range(9), "error": NUMBERS, "word": words})
    point = hand_made(tmp_path, {"hypotheses": table}, truth__name="a, b")
    collate([point], tmp_path / "study")
    written = (tmp_path / "study" / "tables" / "hypotheses.csv").read_bytes()
    assert written == (point.folder / "hypotheses.csv").read_bytes()


def test_rows_are_ordered_by_size_whatever_the_order_of_points(tmp_path: Path) -> None:
    points = [
        point_with(tmp_path, 0.5, -0.25, truth__name=truth, grid__shape=shape, dt=dt)
        for truth in ("a", "b")
        for shape in ([4, 3], [10, 10])  # 12 and 100 cells: as words, 100 would come first
        for dt in (0.25, 0.5, 10.0)
    ]
    collate(points, tmp_path / "one")
    collate([*points[5:], *points[:5]][::-1], tmp_path / "two")
    assert lines(tmp_path / "one")[1:] == rows_of(points)
    tables = {path.name: path.read_bytes() for path in (tmp_path / "one" / "tables").iterdir()}
    assert {p.name: p.read_bytes() for p in (tmp_path / "two" / "tables").iterdir()} == tables
    assert set(tables) == {"summary.csv", "trials.csv", "measures.csv"}


def test_words_of_a_column_come_after_its_numbers(tmp_path: Path) -> None:
    points = [point_with(tmp_path, actions=actions) for actions in (5, 15, "3x5")]
    collate(points[::-1], tmp_path / "study")
    assert lines(tmp_path / "study")[1:] == rows_of(points)


def test_settings_that_the_columns_do_not_tell_become_columns(tmp_path: Path) -> None:
    flat = {"grid__shape": [6, 2]}
    points = [
        point_with(tmp_path, seed=0),
        point_with(tmp_path, seed=0, **flat),
        point_with(tmp_path, seed=1),
    ]
    collate(points[::-1], tmp_path / "study")
    header, *rows = lines(tmp_path / "study")
    assert header == "grid.shape,truth,cells,actions,dt,samples,seed,trial,error"
    shapes = ['"[4, 3]",', '"[6, 2]",', '"[4, 3]",']
    expected = zip(np.repeat(shapes, 2), rows_of(points), strict=True)
    assert rows == [f"{shape}{row}" for shape, row in expected]


def test_a_setting_that_is_nothing_is_an_empty_value(tmp_path: Path) -> None:
    points = [point_with(tmp_path), point_with(tmp_path, grid__offset=[0.5, 0.0])]
    collate(points[::-1], tmp_path / "study")
    header, *rows = lines(tmp_path / "study")
    assert header.startswith("grid.offset,truth,")
    expected = ["", "", '"[0.5, 0.0]"', '"[0.5, 0.0]"']
    assert rows == [
        f"{offset},{row}" for offset, row in zip(expected, rows_of(points), strict=True)
    ]


def test_only_the_settings_that_are_needed_become_columns(tmp_path: Path) -> None:
    points = [point_with(tmp_path, temperature=2.0, tasks__crossing=True), point_with(tmp_path)]
    collate(points, tmp_path / "study")
    header, *rows = lines(tmp_path / "study")
    assert header.startswith("temperature,truth,")
    assert [row.split(",")[0] for row in rows] == ["1.0", "1.0", "2.0", "2.0"]


def attempts(*costs: float) -> dict[str, pd.DataFrame]:
    return {"attempts": pd.DataFrame({"trial": range(len(costs)), "cost": costs})}


def test_a_table_of_the_truth_stands_once_a_seed(tmp_path: Path) -> None:
    points = [
        hand_made(tmp_path, attempts(seed + 0.5, 2.0), seed=seed, dt=dt)
        for seed in (0, 1)
        for dt in (0.25, 0.5)
    ]
    collate(points[::-1], tmp_path / "study")
    assert lines(tmp_path / "study", "attempts")[0] == "truth,seed,trial,cost"
    assert lines(tmp_path / "study", "attempts")[1:] == rows_of(points[::2], "attempts")


def test_tables_of_the_truth_that_differ_say_by_what(tmp_path: Path) -> None:
    """A setting that varies among points with the same rows is not the reason for them."""
    points = [
        hand_made(tmp_path, attempts(cost), tasks__crossing=crossing, temperature=temperature)
        for cost, crossing, temperatures in ((1.0, False, (1.0, 2.0)), (2.0, True, (2.0, 3.0)))
        for temperature in temperatures
    ]
    collate(points, tmp_path / "study")
    assert lines(tmp_path / "study", "attempts") == [
        "tasks.crossing,truth,seed,trial,cost",
        "False,wall,0,0,1.0",
        "True,wall,0,0,2.0",
    ]


def test_a_table_without_rows_keeps_its_header(tmp_path: Path) -> None:
    regions = pd.DataFrame({"region": [], "lower_angle": []})
    points = [hand_made(tmp_path, {"regions": regions}, dt=dt) for dt in (0.25, 0.5)]
    collate(points, tmp_path / "study")
    assert lines(tmp_path / "study", "regions") == ["truth,region,lower_angle"]


def test_an_unfinished_point_is_refused(tmp_path: Path) -> None:
    missing = Point(tmp_path, "f" * 32)
    with pytest.raises(CollateError, match=f"point {missing.identity} is not finished"):
        collate([point_with(tmp_path), missing], tmp_path / "study")
    assert not (tmp_path / "study").exists()


def test_a_mixture_of_sources_is_refused_unless_it_is_allowed(tmp_path: Path) -> None:
    points = [point_with(tmp_path, seed=seed) for seed in (0, 1)]
    points.append(point_with(tmp_path, seed=2, record={"source": "edited"}))
    with pytest.raises(CollateError, match="different versions of the source") as error:
        collate(points, tmp_path / "study")
    _, most, least = str(error.value).splitlines()
    assert most.endswith(f": 2 points, such as {points[0].identity}")
    assert least == f"  edited: 1 point, such as {points[2].identity}"
    assert not (tmp_path / "study").exists()
    collate(points, tmp_path / "study", mixed=True)
    collated = study_of(tmp_path / "study").collated
    assert collated is not None
    assert dict(collated.sources) == {points[0].source: 2, "edited": 1}


def test_other_columns_are_refused(tmp_path: Path) -> None:
    other = pd.DataFrame({"trial": [0], "miss": [0.5]})
    points = [point_with(tmp_path, seed=0), hand_made(tmp_path, {"trials": other}, seed=1)]
    with pytest.raises(CollateError, match=r"the columns of .*trials.csv are .*,miss, not .*error"):
        collate(points, tmp_path / "study")


def test_points_of_two_systems_stand_in_one_table(tmp_path: Path) -> None:
    """With the columns of both, and a version of the source each."""
    other = pd.DataFrame({"trial": [0, 1], "miss": [0.5, 0.25]})
    wheel = {"target": "mlci.zoo.unicycle.Unicycle", "arguments": {}}
    points = [point_with(tmp_path), hand_made(tmp_path, {"trials": other}, system=wheel)]
    assert points[0].source != points[1].source
    collate(points, tmp_path / "study")
    header, *rows = lines(tmp_path / "study")
    assert header == "system.target,truth,cells,actions,dt,samples,seed,trial,error,miss"
    opening = "wall,12,3,0.5,1,0"
    assert rows == [
        f"mlci.systems.DoubleIntegrator,{opening},0,0.5,",
        f"mlci.systems.DoubleIntegrator,{opening},1,0.25,",
        f"mlci.zoo.unicycle.Unicycle,{opening},0,,0.5",
        f"mlci.zoo.unicycle.Unicycle,{opening},1,,0.25",
    ]
    collated = study_of(tmp_path / "study").collated
    assert collated is not None
    assert len(collated.sources) == len(collated.systems) == 2


def test_points_of_two_sizes_of_one_system_stand_in_one_table(tmp_path: Path) -> None:
    """A chain of two links has other states than one of three."""
    parts = [
        hand_made(
            tmp_path,
            {"trials": pd.DataFrame({"trial": [0], f"joint_{links}": [0.5]})},
            system={"target": "mlci.zoo.unicycle.Unicycle", "arguments": {"links": links}},
        )
        for links in (2, 3)
    ]
    collate(parts, tmp_path / "study")
    header, *rows = lines(tmp_path / "study")
    assert header.endswith("seed,trial,joint_2,joint_3")
    assert [row.split(",")[-3:] for row in rows] == [["0", "0.5", ""], ["0", "", "0.5"]]


def test_two_versions_of_one_of_two_systems_are_a_mixture(tmp_path: Path) -> None:
    wheel = {"target": "mlci.zoo.unicycle.Unicycle", "arguments": {}}
    points = [point_with(tmp_path), point_with(tmp_path, system=wheel)]
    points.append(
        hand_made(tmp_path, trials(0.5), system=wheel, seed=1, record={"source": "edited"})
    )
    with pytest.raises(CollateError, match="these points come from different versions"):
        collate(points, tmp_path / "study")


def test_a_missing_table_is_refused(tmp_path: Path) -> None:
    points = [point_with(tmp_path, seed=0), hand_made(tmp_path, seed=1)]
    with pytest.raises(CollateError, match=f"point {points[1].identity} has no table trials.csv"):
        collate(points, tmp_path / "study")


def test_a_refusal_leaves_all_old_tables(tmp_path: Path) -> None:
    points = [point_with(tmp_path, seed=seed) for seed in (0, 1)]
    collate(points[:1], tmp_path / "study")
    before = {path: path.read_bytes() for path in (tmp_path / "study").rglob("*.*")}
    path = points[1].folder / "trials.csv"
    path.write_bytes(path.read_bytes().replace(b"0.25", b"0.26"))
    with pytest.raises(CollateError, match=r"trials.csv is not as its point wrote it"):
        collate(points, tmp_path / "study")
    assert {path: path.read_bytes() for path in (tmp_path / "study").rglob("*.*")} == before


def test_the_study_keeps_its_plan_and_lists_what_its_tables_came_from(tmp_path: Path) -> None:
    points = [point_with(tmp_path, seed=seed) for seed in (1, 0)]
    folder, examples = tmp_path / "study", {"ranking": []}
    plan = [(point, [f"seed={point.config['seed']}"]) for point in points]
    write_plan(folder, plan, examples)
    paths = collate(points, folder)
    listing, study = (folder / "study.json").read_bytes(), study_of(folder)
    assert study.points == {points[0].identity: ("seed=1",), points[1].identity: ("seed=0",)}
    assert study.examples == examples
    assert study.collated is not None
    assert study.collated.points == (points[1].identity, points[0].identity)
    assert [path.name for path in paths] == sorted(study.collated.tables)
    for path in paths:
        assert digest(path.read_bytes()) == study.collated.tables[path.name]
    assert set(study.collated.tables) == {"measures.csv", "summary.csv", "trials.csv"}
    # Another sweep that starts, and ends, in the same way.
    write_plan(folder, plan, examples)
    collate(points[::-1], folder)
    assert (folder / "study.json").read_bytes() == listing


def test_a_listing_that_is_broken_is_written_anew(tmp_path: Path) -> None:
    point, path = point_with(tmp_path), tmp_path / "study" / "study.json"
    path.parent.mkdir()
    path.write_text("{")
    collate([point], path.parent)
    assert list(study_of(path.parent).points) == [point.identity]


def test_a_table_that_is_not_made_any_more_goes(tmp_path: Path) -> None:
    point, folder = point_with(tmp_path), tmp_path / "study"
    collate([point], folder)
    listed = read_sealed(folder / "study.json")["collated"]
    tables = {**listed["tables"], "former.csv": "0" * 64}
    alter(folder / "study.json", collated={**listed, "tables": tables})
    for name in ("former.csv", "mine.csv"):
        (folder / "tables" / name).touch()
    collate([point], folder)
    assert not (folder / "tables" / "former.csv").exists()
    assert (folder / "tables" / "mine.csv").exists()


def test_examples_and_cases_of_the_plan_become_tables(tmp_path: Path) -> None:
    messages: list[str] = []
    points = [point_with(tmp_path, seed=seed) for seed in (0, 1)]
    examples = {"ranking": [{"seed": 7}]}
    write_plan(tmp_path / "study", [(point, ["case='a: b'"]) for point in points], examples)
    collate(points, tmp_path / "study", log=messages.append)
    assert lines(tmp_path / "study", "cases") == [
        "truth,cells,actions,dt,samples,case,choice,value",
        "wall,12,3,0.5,1,a: b,a,b",
    ]
    assert messages == ["examples.ranking: no point of truth wall is as named, so it shows none"]


def test_tables_stay_as_they_were_if_collating_fails(tmp_path: Path) -> None:
    point, folder = point_with(tmp_path), tmp_path / "study"
    collate([point], folder)
    before = {path.name: path.read_bytes() for path in (folder / "tables").iterdir()}
    (point.folder / "trials.csv").write_text("cut")
    with pytest.raises(CollateError, match="not as its point wrote it"):
        collate([point], folder)
    assert {path.name: path.read_bytes() for path in (folder / "tables").iterdir()} == before
    assert sorted(path.name for path in folder.iterdir()) == ["runs.json", "study.json", "tables"]


def test_a_path_in_a_listing_is_never_followed(tmp_path: Path) -> None:
    point, folder = point_with(tmp_path), tmp_path / "study"
    collate([point], folder)
    victim = tmp_path / "victim.txt"
    victim.write_text("of somebody else")
    listed = read_sealed(folder / "study.json")["collated"]
    for name in ("../../victim.txt", str(victim)):
        alter(folder / "study.json", collated={**listed, "tables": {name: "0" * 64}})
        collate([point], folder)
        assert victim.read_text() == "of somebody else"


def collated_again(folder: Path, results: Path, *costs: float, **record: Any) -> Study:
    """The study of one point whose attempts cost so much, run and collated anew."""
    point = hand_made(results, {**attempts(*costs), **trials(0.5)}, record=record)
    collate([point], folder)
    return study_of(folder)


def test_a_table_that_agrees_with_the_one_there_stays_as_it_is(tmp_path: Path) -> None:
    """As after the same points on another machine: other digits, other times, the same tables."""
    folder, table = tmp_path / "study", tmp_path / "study" / "tables" / "attempts.csv"
    first = collated_again(folder, tmp_path, 0.25, 1 / 3)
    before = table.read_bytes()
    again = collated_again(folder, tmp_path, 0.25, 1 / 3 + 1e-10, started="2027", attempt=2)
    assert table.read_bytes() == before
    assert (first.collated.kept, again.collated.kept) == ((), ("attempts.csv",))
    assert again.collated.tables == first.collated.tables
    # Times stand in a file of their own.
    listing = json.loads((folder / "study.json").read_bytes())["collated"]
    assert not {"started", "seconds", "machines", "peak_memory_mb"} & set(listing)
    runs = json.loads((folder / "runs.json").read_bytes())
    assert (runs["started"], runs["attempts"]) == (["2027", "2027"], [2])
    assert (again.collated.started, again.collated.attempts) == (("2027", "2027"), (2,))
    # What differs by more, or was changed by somebody, is written anew.
    other = collated_again(folder, tmp_path, 0.25, 1 / 3 + 1e-7)
    assert (other.collated.kept, table.read_bytes() != before) == ((), True)
    table.write_bytes(table.read_bytes().replace(b"0.25", b"0.2500000001"))
    assert collated_again(folder, tmp_path, 0.25, 1 / 3 + 1e-7).collated.kept == ()
    assert b"0.25\n" in table.read_bytes()


def test_a_study_is_read_without_the_times_of_its_points(tmp_path: Path) -> None:
    collated_again(tmp_path / "study", tmp_path, 1.0, started="2027")
    (tmp_path / "study" / "runs.json").write_text("{")
    assert study_of(tmp_path / "study").collated.started == ("", "")


@pytest.mark.parametrize(
    "front",
    [
        {"a": True, "b": 1, "c": 1.0, "d": 1e-05, "e": "words, and more", "f": None},
        {"a": None},
        {"a": '[1,"two"]', "b": 0.1 + 0.2},
    ],
)
@pytest.mark.parametrize("name", ["plain", "quoted", "empty"])
def test_values_before_a_row_are_spelt_as_pandas_spells_them(
    front: dict[str, Any], name: str, tmp_path: Path
) -> None:
    tables = {
        "plain": pd.DataFrame({"x": [0.1, np.nan], "y": ["one", "two words"]}),
        "quoted": pd.DataFrame({"x": ['says "so"', "two\nlines"], "y": ["a,b", "c"]}),
        "empty": pd.DataFrame({"x": [], "y": []}),
    }
    content = tables[name].to_csv(index=False, lineterminator="\n").encode()
    (tmp_path / f"{name}.csv").write_bytes(content)
    point = FinishedPoint("", tmp_path, {"files": {f"{name}.csv": digest(content)}})
    table = point.table(name)
    expected = pd.DataFrame({**front, **table}, index=table.index)
    text = expected.to_csv(index=False, header=False, lineterminator="\n")
    assert _opened(point, name, front) == text.encode()
