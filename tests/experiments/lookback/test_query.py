"""Conditions on points: each sign at its threshold, several values, and what cannot be read."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from hand_made import hand_made

from experiments.lookback.archive import ArchiveError, Facts
from experiments.lookback.query import Condition, select, varying


@pytest.mark.parametrize(
    ("condition", "facts", "others"),
    [
        ("dt<=0.25", [0.2, 0.25], [0.26, "fast", None]),
        ("dt<0.25", [0.2], [0.25, 0.3]),
        ("dt>=0.25", [0.25, 1], [0.2]),
        ("dt>0.25", [0.26], [0.25]),
        ("dt=1", [1, 1.0, "1"], [2, "one"]),
        ("dt == 1.0", [1], [1.1]),
        ("dt=1,0.5", [1.0, 0.5], [0.75]),
        ("dt!=1", [2], [1.0]),
        ("dt!=1,2", [3], [1, 2]),
        ("truth=c1", ["c1"], ["c2", 1]),
        ("grid.shape=[20,20]", ["[20, 20]"], ["[20, 21]"]),
        ("safety.margin=null", [None], [0.0]),
        ("demonstrations.clip=true", [True], [False]),
    ],
)
def test_condition(condition: str, facts: list[object], others: list[object]) -> None:
    read = Condition.read(condition)
    assert [read.holds(fact) for fact in facts] == [True] * len(facts)
    assert [read.holds(fact) for fact in others] == [False] * len(others)


@pytest.mark.parametrize("text", ["dt", "dt<", "=1", "dt~1"])
def test_condition_that_cannot_be_read(text: str) -> None:
    with pytest.raises(ArchiveError, match=f"{text}: cannot be read as key=value; try dt<=0.25"):
        Condition.read(text)


@pytest.fixture
def points(tmp_path: Path) -> list[Facts]:
    return [
        Facts(
            hand_made(
                tmp_path, {"summary": pd.DataFrame({"stay": [dt / 2]})}, dt=dt, temperature=warm
            )
        )
        for dt, warm in ((0.25, 1.0), (0.5, 1.0), (1.0, 2.0))
    ]


def test_points_meet_all_conditions_on_config_and_summary(points: list[Facts]) -> None:
    assert select(points, ["temperature=1"]) == points[:2]
    assert select(points, ["temperature=1", "stay>=0.25"]) == points[1:2]
    assert select(points, ["cells=12", "truth.name=wall"]) == points
    assert select(points, ["dt=7"]) == []


def test_a_key_that_no_point_has_is_named(points: list[Facts]) -> None:
    with pytest.raises(ArchiveError, match=r"stey: no point has this key; did you mean stay\?"):
        select(points, ["stey=1"])
    assert select([], ["stey=1"]) == []


def test_varying_keys_are_those_of_the_config(points: list[Facts]) -> None:
    assert varying(points) == ["dt", "temperature"]
    assert varying(points[:2]) == ["dt"]
    unknown = Facts(type(points[0].point)(points[0].point.results, "0" * 32))
    assert varying([points[0], unknown]) == []
