"""Locks between sweeps of one study."""

from pathlib import Path

import pytest

from experiments.tracking.locks import StudyInUse, sweep_lock

ONE, OTHER = ["a", "b"], ["a", "c"]


def test_sweeps_of_the_same_points_share_a_study_and_others_wait(tmp_path: Path) -> None:
    study = tmp_path / "s"
    with sweep_lock(study, ONE):
        with sweep_lock(study, ONE[::-1]):
            pass
        with pytest.raises(StudyInUse, match="s is being written by another sweep"):
            sweep_lock(study, OTHER).__enter__()
        with sweep_lock(tmp_path / "t", OTHER):
            pass
    with sweep_lock(study, OTHER):
        pass


def test_a_lock_of_a_killed_sweep_holds_nobody_up(tmp_path: Path) -> None:
    left = tmp_path / ".locks" / "s" / "0123-ab.sweep.lock"
    left.parent.mkdir(parents=True)
    left.touch()
    with sweep_lock(tmp_path / "s", ONE):
        assert not left.exists()
