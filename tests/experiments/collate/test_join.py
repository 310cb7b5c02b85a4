"""Points on disk, and tables that hold exactly what points wrote."""

import csv
import dataclasses
import io
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tiny_point import computed, hopeless, planned

from experiments.collate.examples import example_tables
from experiments.collate.join import CollateError, collate
from experiments.collate.settings_of import settings_of
from experiments.config.settings import Settings
from experiments.point.run import run_point
from experiments.point.tables import TRUTH_TABLES, table_bytes
from experiments.tracking.files import csv_bytes, digest
from experiments.tracking.points import Point
from experiments.tracking.store import Store
from experiments.tracking.study import StudyError, read_study, write_plan

NUMBERS = [1 / 3, 1e-300, 5e-324, -0.1, -0.0, 2**53 + 1.0, np.nextafter(1, 2), np.inf, np.nan]


def finished(settings: Settings, results: Path, **changes: object) -> Point:
    return computed(dataclasses.replace(settings, **changes), results)


def rewrite_record(point: Point, **changes: object) -> None:
    path = point.folder / "record.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def joined(name: str, points: Sequence[Point], extra: str = "", values: Sequence[str] = ()) -> str:
    """The points' own tables one after the other, with columns in front of them."""
    tables = [(point.folder / name).read_text().splitlines(keepends=True) for point in points]
    rows = [
        value + row
        for table, value in zip(tables, values or [""] * len(tables), strict=True)
        for row in table[1:]
    ]
    assert len(rows) >= len(points)
    return "".join([extra + tables[0][0], *rows])


def test_finished_point_has_a_record_and_exact_tables(settings: Settings, tmp_path: Path) -> None:
    point = finished(settings, tmp_path, seed=1)
    assert point.is_done()
    table = pd.read_csv(point.folder / "trials.csv")
    assert list(table.columns[:6]) == ["truth", "cells", "actions", "dt", "samples", "seed"]
    assert table.iloc[0, :6].tolist() == ["wall", 96, 3, 0.5, 1, 1]
    lines: list[str] = []
    by_name = run_point(settings_of(point), Store(tmp_path / "store"), lines.append)
    assert {path.stem for path in point.folder.glob("*.csv")} == set(by_name)
    for name, frame in by_name.items():
        table = pd.read_csv(point.folder / f"{name}.csv")
        opening = len(TRUTH_TABLES.get(name, settings_of(point).columns))
        assert list(table.columns[opening:]) == list(frame.columns)
        for column in frame.columns:
            np.testing.assert_array_equal(table[column], frame[column])
    record = json.loads((point.folder / "record.json").read_text())
    assert record["identity"] == point.folder.name
    assert record["config"]["grid"] == {"shape": [12, 8], "offset": None}
    assert record["seconds"]["total"] >= 0
    assert record["packages"]["numpy"] == np.__version__
    assert lines
    assert (point.folder / "log.txt").read_text() == "".join(f"{line}\n" for line in lines)


def test_floats_are_exact_in_tables(settings: Settings) -> None:
    frame = pd.DataFrame({"truth": "other", "trial": range(len(NUMBERS)), "error": NUMBERS})
    for data, truth in [
        (csv_bytes(frame), "other"),
        (table_bytes("trials", frame, settings), "wall"),
    ]:
        rows = list(csv.DictReader(io.StringIO(data.decode())))
        assert [row["truth"] for row in rows] == [truth] * len(NUMBERS)
        kept = [float(row["error"] or "nan") for row in rows]
        # As bits: 0.0 is not -0.0 there, and NaN is itself.
        assert np.array(kept).tobytes() == np.array(NUMBERS).tobytes()


@pytest.mark.parametrize("harm", ["table", "record", "source", "missing"])
def test_point_that_is_not_whole_is_not_done(harm: str, settings: Settings, tmp_path: Path) -> None:
    point = finished(settings, tmp_path)
    if harm == "table":
        (point.folder / "trials.csv").write_text("trial\n")
    elif harm == "record":
        (point.folder / "record.json").write_text('{"identity"')
    elif harm == "missing":
        (point.folder / "trials.csv").unlink()
    else:
        rewrite_record(point, source="edited")
    assert not planned(settings, tmp_path).is_done()


def test_point_that_fails_is_not_done_and_keeps_its_traceback(
    settings: Settings, tmp_path: Path
) -> None:
    point = planned(hopeless(settings), tmp_path)
    with pytest.raises(RuntimeError, match="no demonstration was kept"):
        computed(hopeless(settings), tmp_path)
    assert not Point(tmp_path, point.identity).is_done()
    first, second, *rest = (point.folder / "log.txt").read_text().splitlines()
    assert first.startswith("demonstrations  0 of 6 kept")
    assert second.startswith("Traceback")
    assert rest[-1].startswith("RuntimeError: no demonstration was kept")


def test_collate_sorts_by_size_whatever_the_order(settings: Settings, tmp_path: Path) -> None:
    grids = [dataclasses.replace(settings.grid, shape=shape) for shape in [(16, 12), (12, 8)]]
    points = [
        finished(settings, tmp_path, grid=grid, dt=dt) for grid in grids for dt in [1.0, 0.25]
    ]
    collate(points, tmp_path / "one")
    collate(points[::-1], tmp_path / "two")
    names = {path.name for path in points[0].folder.glob("*.csv")}
    written = {path.name for path in (tmp_path / "one" / "tables").iterdir()}
    made = {*example_tables(points), "measures", "rank_curve"}
    assert written == names | {f"{name}.csv" for name in made}
    for name in written:
        one, two = (tmp_path / study / "tables" / name for study in ["one", "two"])
        assert one.read_bytes() == two.read_bytes()
        if name not in names:
            continue
        # What depends on the truth alone stands once.
        rows = points[:1] if Path(name).stem in TRUTH_TABLES else points[::-1]
        assert one.read_text() == joined(name, rows)
    table = pd.read_csv(tmp_path / "one" / "tables" / "hypotheses.csv")
    order = [(96, 0.25), (96, 1.0), (192, 0.25), (192, 1.0)]
    assert list(zip(table["cells"], table["dt"], strict=True)) == [
        pair for pair in order for _ in range(10)
    ]
    assert table["hypothesis"].tolist() == list(range(10)) * 4
    assert len(pd.read_csv(tmp_path / "one" / "tables" / "attempts.csv")) == 6


def test_collate_adds_columns_that_tell_points_apart(settings: Settings, tmp_path: Path) -> None:
    flat = dataclasses.replace(settings.grid, shape=(24, 4))
    points = [
        finished(settings, tmp_path, seed=1),
        finished(settings, tmp_path, seed=0, grid=flat),
        finished(settings, tmp_path, seed=0),
    ]
    collate(points, tmp_path / "study")
    tables = tmp_path / "study" / "tables"
    ordered = [points[2], points[1], points[0]]
    values = ['"[12, 8]",', '"[24, 4]",', '"[12, 8]",']
    for name in ["trials.csv", "ranks.csv", "hypotheses.csv", "summary.csv"]:
        expected = joined(name, ordered, "grid.shape,", values)
        assert (tables / name).read_text() == expected
    table = pd.read_csv(tables / "hypotheses.csv")
    assert list(table.columns[:2]) == ["grid.shape", "truth"]
    assert table["grid.shape"].tolist() == ["[12, 8]"] * 10 + ["[24, 4]"] * 10 + ["[12, 8]"] * 10
    assert table["seed"].tolist() == [0] * 20 + [1] * 10
    # Both grids have the same attempts, which stand once a seed.
    attempts = (tables / "attempts.csv").read_text()
    assert attempts == joined("attempts.csv", ordered[::2])
    assert pd.read_csv(tables / "attempts.csv")["seed"].tolist() == [0] * 6 + [1] * 6
    assert (tables / "dimensions.csv").read_text() == joined("dimensions.csv", points[:1])


def test_cases_that_are_named_join_the_measures(settings: Settings, tmp_path: Path) -> None:
    warm, folder = {"temperature": 2.0}, tmp_path / "study"
    points = [finished(settings, tmp_path, seed=seed) for seed in (0, 1)]
    points += [finished(settings, tmp_path, seed=seed, **warm) for seed in (0, 1)]
    names = ["case=default", "case=default", "case='temperature: 2'", "case='temperature: 2'"]
    collate(points, folder)
    assert not (folder / "tables" / "cases.csv").exists()
    words = [[name, "dt=0.5"] for name in names]
    write_plan(folder, list(zip(points, words, strict=True))[::-1])
    collate(points[::-1], folder)
    tables = (folder / "tables" / f"{name}.csv" for name in ("cases", "measures"))
    cases, measures = (pd.read_csv(table, keep_default_na=False) for table in tables)
    assert cases["case"].tolist() == ["temperature: 2", "default"]  # as planned
    assert cases["choice"].tolist() == ["temperature", "default"]
    assert cases["value"].tolist() == ["2", ""]
    both = measures.merge(cases, how="left", validate="many_to_one")
    assert len(both) == len(measures)
    assert (both["case"] == both["temperature"].map({1: "default", 2: "temperature: 2"})).all()


def test_collate_refuses_an_unfinished_point(settings: Settings, tmp_path: Path) -> None:
    done, missing = finished(settings, tmp_path), planned(settings, tmp_path / "elsewhere")
    with pytest.raises(CollateError, match=f"point {missing.identity} is not finished"):
        collate([done, missing], tmp_path / "study")
    assert not (tmp_path / "study").exists()


def test_collate_refuses_a_mixture_of_sources(settings: Settings, tmp_path: Path) -> None:
    old, new = (finished(settings, tmp_path, seed=seed) for seed in (0, 1))
    rewrite_record(old, source="edited")
    with pytest.raises(CollateError, match="different versions of the source"):
        collate([old, new], tmp_path / "study")


def test_collate_refuses_other_columns(settings: Settings, tmp_path: Path) -> None:
    one, two = (finished(settings, tmp_path, seed=seed) for seed in (0, 1))
    record, trials = two.record(), two.folder / "trials.csv"
    assert record is not None
    trials.write_bytes(csv_bytes(pd.read_csv(trials).drop(columns="violation_floor")))
    rewrite_record(two, files=record["files"] | {"trials.csv": digest(trials.read_bytes())})
    assert two.is_done()
    with pytest.raises(CollateError, match=r"the columns of .*trials.csv are"):
        collate([one, two], tmp_path / "study")


def test_collate_mixes_sources_when_told_and_lists_them(settings: Settings, tmp_path: Path) -> None:
    points = [finished(settings, tmp_path, seed=seed) for seed in (0, 1, 2)]
    rewrite_record(points[2], source="edited")
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
    trials.write_bytes(trials.read_bytes().replace(b"wall", b"well", 1))
    with pytest.raises(CollateError, match=r"trials.csv is not as its point wrote it"):
        collate(points, tmp_path / "study")
    assert {path: path.read_bytes() for path in (tmp_path / "study").rglob("*.*")} == before


def test_listing_keeps_plan_and_tables_apart(settings: Settings, tmp_path: Path) -> None:
    points = [finished(settings, tmp_path, seed=seed) for seed in (1, 0)]
    folder = tmp_path / "study"
    write_plan(folder, [(point, [f"seed={point.config['seed']}"]) for point in points])
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
    assert {"measures.csv", "rank_curve.csv", "trials.csv"} < set(study.collated.tables)
    for name, was in study.collated.tables.items():
        assert digest((folder / "tables" / name).read_bytes()) == was
    assert study.collated.started[0] <= study.collated.started[1]
    # Another sweep that starts, and ends, in the same way.
    write_plan(folder, [(point, [f"seed={point.config['seed']}"]) for point in points])
    assert (folder / "study.json").read_bytes() == listing
    collate(points, folder)
    assert (folder / "study.json").read_bytes() == listing


def test_a_table_that_is_not_made_any_more_goes(settings: Settings, tmp_path: Path) -> None:
    point, folder = finished(settings, tmp_path), tmp_path / "study"
    collate([point], folder)
    listing = json.loads((folder / "study.json").read_text())
    listing["collated"]["tables"]["former.csv"] = "0"
    (folder / "study.json").write_text(json.dumps(listing))
    for name in ("former.csv", "mine.csv"):
        (folder / "tables" / name).touch()
    collate([point], folder)
    assert not (folder / "tables" / "former.csv").exists()
    assert (folder / "tables" / "mine.csv").exists()


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
