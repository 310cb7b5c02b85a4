"""Starts and goals from a table."""

import os
from pathlib import Path

import numpy as np
import pytest

from mlci.recordings.task_table import read_task_table, unmatched
from mlci.systems import Pendulum

SPACE = Pendulum().space
GOALS = "goal_lower_angle,goal_lower_angular_velocity,goal_upper_angle,goal_upper_angular_velocity"
STARTS = "start_angle,start_angular_velocity"


def test_starts_and_goals_stand_by_the_names_of_trials(tmp_path: Path) -> None:
    file = tmp_path / "tasks.csv"
    file.write_text(f"trial,{STARTS},{GOALS}\n01,1,0,2,-inf,2.5,inf\nb,2,0.5,3,0,3,0\n")
    table = read_task_table(file, SPACE)
    assert list(table) == ["01", "b"]
    first = table["01"]
    assert first.start is not None
    assert first.goal is not None
    assert first.start.tolist() == [1.0, 0.0]
    assert first.goal.lower.tolist() == [2.0, -np.inf]
    assert first.goal.upper.tolist() == [2.5, np.inf]
    assert unmatched(table, ["b", "01"]) == []
    assert unmatched(table, ["b", "c"]) == [
        "has no row for c: start and goal are read off the path",
        "has rows for trials that are not there: 01",
    ]


def test_either_may_be_left_to_the_paths(tmp_path: Path) -> None:
    file = tmp_path / "tasks.tsv"
    file.write_text(f"trial\t{STARTS}\na\t1\t0\n".replace(",", "\t"))
    assert read_task_table(file, SPACE)["a"].goal is None
    file.write_text(f"trial;{GOALS}\na;1;0;2;0\n".replace(",", ";"))
    assert read_task_table(file, SPACE)["a"].start is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("trial,start_angle\na,1\n", "needs a column trial, and start_angle"),
        (f"name,{STARTS}\na,1,0\n", "it has name, start_angle"),
        (f"trial,{STARTS}\na,1,0\na,2,0\n", "has trial 'a' twice"),
        (f"trial,{STARTS}\na,1,x\n", "trial 'a' has no number for start_angular_velocity"),
        (f"trial,{GOALS}\na,3,0,2,0\n", "trial 'a' has a goal that is no box"),
        (f"trial,{GOALS}\na,3,0,inf,0\n", "trial 'a' has a goal that is no box"),
        ("", "is no table"),
    ],
)
def test_what_is_no_table_of_tasks_is_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "tasks.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=message):
        read_task_table(file, SPACE)


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(ValueError, match=r"pipe.csv: is not a file"):
        read_task_table(tmp_path / "pipe.csv", SPACE)
