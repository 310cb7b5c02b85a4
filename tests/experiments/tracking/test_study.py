"""A study on disk: its plan and what its tables came from, each written beside the other."""

import dataclasses
import json
from pathlib import Path

import pytest

from experiments.tracking.points import Point
from experiments.tracking.study import (
    Collated,
    StudyError,
    collated,
    read_study,
    table_source,
    whole_study,
    write_collated,
    write_plan,
)

EXAMPLES = {"example_ranking": {"dt": 0.25, "truth": ["c1", "c2"]}}
X, Y = "1" * 32, "2" * 32
RECORD = {
    "started": "2026-01-02",
    "python": "3.11",
    "packages": {"numpy": "2.0", "pebble": None},
    "source": "b",
    "config": {"system": {"target": "mine.System"}},
    "git": {"commit": "c" * 40, "dirty": False},
    "seconds": {"total": 1.26},
    "peak_memory_mb": 100,
    "cpu": "fast",
    "cores": 2,
    "system": "Linux",
}


def of_records(tables: dict[str, str]) -> Collated:
    """What tables came from, of two points."""
    first = {**RECORD, "git": {"commit": None, "dirty": True}, "started": "2026-01-03"}
    second = {**RECORD, "source": "a", "seconds": {"total": 2.0}, "peak_memory_mb": 90}
    return collated({Y: first, X: second}, tables)


def test_tables_come_from_all_records() -> None:
    assert of_records({"summary.csv": "0" * 64}) == Collated(
        points=(Y, X),
        sources={"a": 1, "b": 1},
        systems=("mine",),
        made_by=table_source(),
        commits=("c" * 40,),
        dirty=True,
        started=("2026-01-02", "2026-01-03"),
        seconds=3.3,
        peak_memory_mb=100,
        machines=("fast, 2 cores, Linux",),
        attempts=(1, 1),
        versions=("numpy 2.0", "python 3.11"),
        tables={"summary.csv": "0" * 64},
    )


def test_study_is_read_as_it_was_written(tmp_path: Path) -> None:
    assert read_study(tmp_path) is None
    points = [Point.planned({"dt": dt}, tmp_path) for dt in (0.5, 0.25)]
    jobs = [["dt=0.5", "case='one: a'"], ["dt=0.25"]]
    write_plan(tmp_path, list(zip(points, jobs, strict=True)), EXAMPLES)
    plan = read_study(tmp_path)
    assert list(plan.points.items()) == [
        (point.identity, tuple(job)) for point, job in zip(points, jobs, strict=True)
    ]
    assert (plan.name, plan.examples, plan.collated) == (tmp_path.name, EXAMPLES, None)
    assert json.loads((tmp_path / "study.json").read_bytes())["examples"] == EXAMPLES
    # Tables leave the plan as it is, and the next plan leaves them.
    tables = of_records({"summary.csv": "0" * 64})
    write_collated(tmp_path, tables)
    assert read_study(tmp_path) == dataclasses.replace(plan, collated=tables)
    write_plan(tmp_path, [(points[1], ["dt=0.25"])])
    again = read_study(tmp_path)
    assert (list(again.points), again.examples) == ([points[1].identity], {})
    assert again.collated == tables


def test_tables_without_a_plan_list_their_points(tmp_path: Path) -> None:
    write_collated(tmp_path, of_records({}))
    assert read_study(tmp_path).points == {Y: (), X: ()}


@pytest.mark.parametrize("text", ["{", "[]", "{}", '{"points": {}, "collated": {"points": []}}'])
def test_broken_listing_is_named_and_written_anew(text: str, tmp_path: Path) -> None:
    path = tmp_path / "study.json"
    path.write_text(text)
    with pytest.raises(StudyError, match=f"{path} cannot be read as a study"):
        read_study(tmp_path)
    assert whole_study(tmp_path) is None
    write_plan(tmp_path, [])
    assert read_study(tmp_path).points == {}
