"""Which points of a plan run."""

from pathlib import Path
from typing import Any

import pytest
from tiny_point import TINY, composed

from experiments.config.settings import SweepSettings
from experiments.sweep.plan import PlannedPoint, count_states, read_point, select_points
from experiments.tracking.points import Point, State
from experiments.tracking.trees import plain

PLAN = [
    PlannedPoint((), f"{state} {i}", Point(Path(), f"{i}{state}"), state)
    for i in range(2)
    for state in State
    if state is not State.SHIPPED  # never of a sweep's points
]
DEFAULTS = dict.fromkeys(("only", "limit", "time_limit", "retries")) | dict.fromkeys(
    ("force", "fail_fast", "dry_run", "mix_sources", "replace"), False
)


@pytest.mark.parametrize(
    ("options", "states"),
    [
        ({}, ["stale", "failed", "running", "missing"]),
        ({"force": True}, ["done", "stale", "failed", "running", "missing"]),
        ({"only": ("failed", "missing")}, ["failed", "missing"]),
        ({"only": ("stale",), "force": True}, ["stale"]),
        ({"only": ()}, []),
    ],
)
def test_points_that_run_depend_on_their_state(options: dict[str, Any], states: list[str]) -> None:
    selection = select_points(PLAN, SweepSettings(**{**DEFAULTS, "retries": 0, **options}))
    assert [each.name for each in selection] == [f"{state} {i}" for i in (0, 1) for state in states]


def test_limit_counts_the_points_that_run() -> None:
    options = SweepSettings(**{**DEFAULTS, "retries": 0, "only": ("failed",), "limit": 1})
    assert [each.name for each in select_points(PLAN, options)] == ["failed 0"]


def test_states_are_counted_in_their_order() -> None:
    assert count_states(PLAN[2:7]) == "1 done, 1 stale, 1 failed, 1 running, 1 missing"
    assert count_states(PLAN[:1] + PLAN[5:6]) == "2 done"


def test_point_of_a_config_has_its_settings_and_folder(tmp_path: Path) -> None:
    tree = composed(*TINY, f"results={tmp_path}", "study=s", "sweep.limit=3")
    point, settings, study = read_point(tree)
    assert point == Point.planned(plain(settings), tmp_path)
    assert point.config["actions"] == 3
    assert (study.study, study.sweep.limit) == ("s", 3)
