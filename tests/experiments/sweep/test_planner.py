"""What a sweep says of its plan; how it runs is in `test_sweep`."""

import re
from pathlib import Path

from commands import run_here
from sweeps import TINY

from experiments import run


def plan(folder: Path, *words: str) -> list[str]:
    """The lines of a dry run."""
    done = run_here(
        run.main, "sweep.dry_run=true", f"results={folder / 'r'}", *words, folder=folder
    )
    assert done.returncode == 0, done.stderr
    assert not list(folder.iterdir())
    return done.stdout.splitlines()


def test_equal_combinations_are_one_point(tmp_path: Path) -> None:
    lines = plan(tmp_path, "-m", *TINY, "actions=3,2,3", "dt=1,0.5,1.0", "sweep.limit=3")
    assert lines[:2] == ["4 points: 4 missing; 3 to run", "5 of 9 combinations repeat others"]
    assert [re.sub("[0-9a-f]{8}", "...", line) for line in lines[2:]] == [
        "run missing ...  dt=1 actions=3",
        "run missing ...  dt=1 actions=2",
        "run missing ...  dt=0.5 actions=3",
        "    missing ...  dt=0.5 actions=2",
    ]


def test_study_without_m_says_first_how_many_points_will_run(tmp_path: Path) -> None:
    lines = plan(tmp_path, "experiment=in_cell", "scale=smoke")
    assert lines[:2] == [
        "12 points: 12 missing; 12 to run",
        "dt: 0.1 and 1.0 stand for all of 0.1, 0.2, 0.25, 0.5, 1.0",
    ]
    assert len(lines) == 2 + 12
