"""A finished point as its record and tables have it."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from hand_made import alter, hand_made

from experiments.collate.finished import CollateError, FinishedPoint
from experiments.tracking.points import Point


def test_opening_columns_end_with_the_seed(tmp_path: Path) -> None:
    point = FinishedPoint.read(hand_made(tmp_path, seed=3, dt=0.25, actions="5x3"))
    assert list(point.opening.items()) == [
        ("truth", "wall"),
        ("cells", "12"),
        ("actions", "5x3"),
        ("dt", "0.25"),
        ("samples", "1"),
        ("seed", "3"),
    ]


def test_values_are_strings_as_they_are_spelt(tmp_path: Path) -> None:
    table = pd.DataFrame({"trial": [0, 1], "error": ["1e-5", ""], "goal": ["NA", "007"]})
    point = FinishedPoint.read(hand_made(tmp_path, {"trials": table}))
    assert point.tables == ["summary", "trials"]
    assert point.table("trials")["error"].tolist() == ["1e-5", ""]
    assert point.table("trials")["goal"].tolist() == ["NA", "007"]
    assert point.table("trials")["trial"].tolist() == ["0", "1"]


def test_config_is_known_by_dotted_keys(tmp_path: Path) -> None:
    config = FinishedPoint.read(hand_made(tmp_path, tasks__crossing=True)).config
    assert config["tasks.crossing"] is True
    assert config["grid.shape"] == "[4, 3]"
    assert config["grid.offset"] is None


@pytest.mark.parametrize("harm", ["missing", "broken", "of another point"])
def test_a_point_without_a_record_is_refused(harm: str, tmp_path: Path) -> None:
    point = hand_made(tmp_path)
    path = point.folder / "record.json"
    if harm == "missing":
        path.unlink()
    elif harm == "broken":
        path.write_text('{"identity"')
    else:
        alter(path, identity="0" * 32)
    with pytest.raises(CollateError, match=f"point {point.identity} is not finished: {tmp_path}"):
        FinishedPoint.read(Point(tmp_path, point.identity))


def test_a_table_that_is_not_as_written_is_refused(tmp_path: Path) -> None:
    point = FinishedPoint.read(hand_made(tmp_path))
    path = point.folder / "summary.csv"
    path.write_text(path.read_text().replace("wall", "well"))
    with pytest.raises(CollateError, match=r"summary.csv is not as its point wrote it; run"):
        point.table("summary")
    path.unlink()
    with pytest.raises(CollateError, match=f"point {point.identity} has no table summary.csv"):
        point.table("summary")
    with pytest.raises(CollateError, match=f"point {point.identity} has no table ranks.csv"):
        point.table("ranks")
