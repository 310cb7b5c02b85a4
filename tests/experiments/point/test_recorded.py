"""What the settings say of recordings reaches who reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from tiny_point import composed

from experiments.config.read import read_recorded_config
from experiments.point.recorded import read_recordings
from mlci.recordings.read import Readings

WALK = "time,angle,angular_velocity\n0,1,0\n1,1.1,0\n2,1.2,0\n"


def readings(folder: Path, *words: str, text: str = WALK) -> Readings:
    """What comes of one file."""
    (folder / "a.csv").write_text(text)
    words = (f"demonstrations={folder / 'a.csv'}", *words)
    return read_recordings(read_recorded_config(composed(*words, name="infer")))


def test_start_and_goal_of_the_settings_are_the_task(tmp_path: Path) -> None:
    words = ["start=[1.01,0.0]", "goal={lower: [1.0,null], upper: [1.3,null]}"]
    (demonstration,), problems, _ = readings(tmp_path, *words)
    assert problems == []
    assert demonstration.task.start.tolist() == [1.01, 0.0]
    assert demonstration.task.goal.lower.tolist() == [1.0, -np.inf]
    assert demonstration.task.goal.upper.tolist() == [1.3, np.inf]
    (own,), *_ = readings(tmp_path)
    assert own.task.start.tolist() == [1.0, 0.0]
    assert own.task.goal.upper.tolist() == [1.2, 0.0]


def test_a_gap_is_bridged_up_to_a_share_of_a_cell(tmp_path: Path) -> None:
    """It moves by 0.2 rad across the gap; a cell of the grid is 2 pi / 20 wide."""
    text = WALK.replace("1.1", "")
    for share, count in ((0.64, 1), (0.63, 0)):
        found = readings(tmp_path, "grid=400", f"bridge={share}", text=text)
        assert len(found.demonstrations) == count
