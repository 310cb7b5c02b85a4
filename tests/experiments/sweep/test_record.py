"""What a point leaves: exact tables and a record, or a traceback."""

import csv
import dataclasses
import io
import json
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hand_made import alter
from tiny_point import computed, hopeless, planned

from experiments.config.settings import Settings
from experiments.point.run import run_point
from experiments.point.tables import TRUTH_TABLES, table_bytes
from experiments.sweep.record import write_failure
from experiments.tracking.files import csv_bytes
from experiments.tracking.points import Point
from experiments.tracking.store import Store
from experiments.tracking.tables import rounded

NUMBERS = [1 / 3, 1e-300, 5e-324, -0.1, -0.0, 2**53 + 1.0, np.nextafter(1, 2), np.inf, np.nan]


def test_finished_point_has_a_record_and_its_tables(settings: Settings, tmp_path: Path) -> None:
    settings = dataclasses.replace(settings, seed=1)
    point = computed(settings, tmp_path)
    assert point.is_done()
    table = pd.read_csv(point.folder / "trials.csv")
    assert list(table.columns[:6]) == ["truth", "cells", "actions", "dt", "samples", "seed"]
    assert table.iloc[0, :6].tolist() == ["wall", 96, 3, 0.5, 1, 1]
    lines: list[str] = []
    by_name = run_point(settings, Store(tmp_path / "store"), lines.append)
    assert {path.stem for path in point.folder.glob("*.csv")} == set(by_name)
    for name, frame in by_name.items():
        frame = rounded(frame)
        table = pd.read_csv(point.folder / f"{name}.csv")
        opening = len(TRUTH_TABLES.get(name, settings.columns))
        assert list(table.columns[opening:]) == list(frame.columns)
        for column in frame.columns:
            np.testing.assert_array_equal(table[column], frame[column])
    record = json.loads((point.folder / "record.json").read_text())
    assert record["identity"] == point.folder.name
    assert record["config"]["grid"] == {"shape": [12, 8], "offset": None, "refined": 0}
    assert record["seconds"]["total"] >= 0
    assert record["packages"]["numpy"] == np.__version__
    assert lines
    assert (point.folder / "log.txt").read_text() == "".join(f"{line}\n" for line in lines)


def test_floats_have_ten_digits_in_tables_of_points_and_are_exact_elsewhere(
    settings: Settings,
) -> None:
    frame = pd.DataFrame({"truth": "other", "trial": range(len(NUMBERS)), "error": NUMBERS})
    tenth = rounded(frame)["error"].tolist()
    for data, truth, expected in [
        (csv_bytes(frame), "other", NUMBERS),
        (table_bytes("trials", frame, settings), "wall", tenth),
    ]:
        rows = list(csv.DictReader(io.StringIO(data.decode())))
        assert [row["truth"] for row in rows] == [truth] * len(NUMBERS)
        numbers = [float(row["error"] or "nan") for row in rows]
        # As bits: 0.0 is not -0.0 there, and NaN is itself.
        assert np.array(numbers).tobytes() == np.array(expected).tobytes()


@pytest.mark.parametrize("harm", ["table", "record", "source", "missing"])
def test_point_that_is_not_whole_is_not_done(harm: str, settings: Settings, tmp_path: Path) -> None:
    point = computed(settings, tmp_path)
    if harm == "table":
        (point.folder / "trials.csv").write_text("trial\n")
    elif harm == "record":
        (point.folder / "record.json").write_text('{"identity"')
    elif harm == "missing":
        (point.folder / "trials.csv").unlink()
    else:
        alter(point.folder / "record.json", source="edited")
    assert not planned(settings, tmp_path).is_done()


def test_point_without_a_demonstration_is_not_done_and_says_why(
    settings: Settings, tmp_path: Path
) -> None:
    point = planned(hopeless(settings), tmp_path)
    with pytest.raises(RuntimeError, match="no demonstration was kept"):
        computed(hopeless(settings), tmp_path)
    assert not Point(tmp_path, point.identity).is_done()
    (line,) = (point.folder / "log.txt").read_text().splitlines()
    assert line.startswith("no demonstration was kept: of 6 trials ")
    assert re.search(r"missed the goal \(trial \d the least, by [\d.e-]+; ", line)
    assert "demonstrations.goal_tolerance is 1e-12" in line


@pytest.fixture
def point(tmp_path: Path) -> Point:
    return Point.planned({"dt": 0.5}, tmp_path)


def test_failure_counts_the_time_of_its_own_attempt(point: Point) -> None:
    started = (datetime.now(UTC) - timedelta(seconds=90)).isoformat()
    note = {"identity": point.identity, "attempt": 2, "started": started}
    point.write_note("attempt", note)
    write_failure(point, "died", "killed", "where", 2)
    failure = point.failure()
    assert 90 <= failure.pop("seconds") < 100
    assert failure == {
        "identity": point.identity, "source": point.source, "attempt": 2, "reason": "died",
        "error": "killed", "traceback": "where", "started": started,
    }  # fmt: skip
    assert point.note("attempt") is None
    point.write_note("attempt", note)
    write_failure(point, "died", "killed", "", 3)  # it did not get as far as its own note
    assert (point.failure()["started"], point.failure()["seconds"]) == (None, None)


def test_note_with_a_number_that_json_lacks_is_refused(point: Point) -> None:
    with pytest.raises(ValueError, match="JSON"):
        point.write_note("record", {"seconds": float("nan")})
    assert not list(point.results.rglob("record.json"))
