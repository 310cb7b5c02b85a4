"""What a sweep says of its plan; how it runs is in `test_sweep`."""

import re
from pathlib import Path

from commands import run_here
from sweeps import TINY
from sweeps import run_here as sweep_here

from experiments import run
from experiments.tracking.locks import sweep_lock
from experiments.tracking.points import Point
from experiments.tracking.study import write_plan


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


def test_a_sweep_that_would_drop_points_of_its_study_asks(tmp_path: Path) -> None:
    other = Point.planned({"dt": 3}, tmp_path / "results")
    write_plan(tmp_path / "results" / "s", [(other, ["dt=3"])])
    listing = (tmp_path / "results" / "s" / "study.json").read_bytes()
    status, _, err = sweep_here(tmp_path, "-m", "dt=1.0", "study=s")
    assert status == 2
    assert "study: s has 1 points, and 1 of them are not in this sweep" in err
    assert "sweep.replace=true" in err
    assert (tmp_path / "results" / "s" / "study.json").read_bytes() == listing
    assert not list((tmp_path / "results").glob("points/*"))
    status, out, _ = sweep_here(tmp_path, "-m", "dt=1.0", "study=s", "sweep.dry_run=true")
    assert status == 0
    assert "sweep.replace=true" in out


def test_a_sweep_without_a_name_gets_one_of_its_points(tmp_path: Path) -> None:
    for _ in range(2):
        status, _, err = sweep_here(tmp_path, "-m", "dt=1.0")
        assert status == 0, err
    (study,) = (tmp_path / "results").glob("*/study.json")
    assert study.parent.name.startswith("sweep_")


def test_another_sweep_of_other_points_is_refused_while_one_runs(tmp_path: Path) -> None:
    with sweep_lock(tmp_path / "results" / "s", ["0" * 32]):
        status, _, err = sweep_here(tmp_path, "-m", "dt=1.0", "study=s")
    assert status == 2
    assert "s is being written by another sweep, of other points" in err
