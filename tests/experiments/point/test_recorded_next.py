"""Candidates for what to record next, as the settings say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tiny_point import composed

from experiments.config.problems import ConfigError
from experiments.config.read import read_recorded_config
from experiments.config.settings import RecordedSettings
from experiments.point.recorded_next import candidate_tasks

HEAD = "trial,start_angle,start_angular_velocity"
GOAL = "goal_lower_angle,goal_lower_angular_velocity,goal_upper_angle,goal_upper_angular_velocity"


def settings(*words: str) -> RecordedSettings:
    return read_recorded_config(composed("demonstrations=none", *words, name="infer"))


def test_candidates_are_drawn_from_the_systems_box_unless_another_is_given() -> None:
    tasks = candidate_tasks(settings("next_tasks.candidates=200"), 5.0)
    ends = np.array([[task.start, task.goal.lower, task.goal.upper] for task in tasks.values()])
    assert ends.shape == (200, 3, 2)
    assert np.all(np.abs(ends[..., 1]) <= 2)  # the pendulum's tasks are no faster
    assert np.ptp(ends[..., 0]) > 6
    assert np.array_equal(ends[:, 1], ends[:, 2])
    assert {task.horizon for task in tasks.values()} == {5.0}
    words = "next_tasks.box={lower: [1.0, null], upper: [2.0, null], goal: [0.1, null]}"
    for task in candidate_tasks(settings(words), 5.0).values():
        assert 1 <= task.start[0] <= 2
        assert task.goal.widths == pytest.approx([0.2, np.inf])


def test_without_a_box_the_whole_space_is_taken() -> None:
    tasks = candidate_tasks(settings("tasks=table.csv"), 5.0)  # it takes the place of the box
    assert max(abs(task.start[1]) for task in tasks.values()) > 4


def test_candidates_of_a_table_have_their_names(tmp_path: Path) -> None:
    file = tmp_path / "candidates.csv"
    file.write_text(f"{HEAD},{GOAL}\nreach,1,0,2,-inf,2.5,inf\nrise,0.5,0,3,0,3,0\n")
    tasks = candidate_tasks(settings(f"next_tasks.file={file}"), 4.0)
    assert list(tasks) == ["reach", "rise"]
    assert tasks["reach"].goal.upper.tolist() == [2.5, np.inf]
    assert tasks["rise"].start.tolist() == [0.5, 0.0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{HEAD}\na,1,0\n", "a candidate needs a start and a goal"),
        (f"{HEAD},{GOAL}\na,1,9,1,0,1,0\n", "a starts at .*outside the state space"),
        ("angle\n1\n", "next_tasks.file: .*needs a column trial"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "candidates.csv"
    file.write_text(text)
    with pytest.raises(ConfigError, match=words):
        candidate_tasks(settings(f"next_tasks.file={file}"), 5.0)


def test_a_table_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^next_tasks\.file: .*gone\.csv: No such file"):
        candidate_tasks(settings(f"next_tasks.file={tmp_path}/gone.csv"), 5.0)
    with pytest.raises(ConfigError, match=r"^next_tasks\.file: .*: is not a file"):
        candidate_tasks(settings(f"next_tasks.file={tmp_path}"), 5.0)
    with pytest.raises(ConfigError, match=r"candidates: 10001 must be at most 10000"):
        settings("next_tasks.candidates=10001")


def test_a_box_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"next_tasks\.box\.lower"):
        settings("next_tasks.box={lower: [1.0], upper: [2.0, null]}")
