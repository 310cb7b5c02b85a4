"""Tables are called current where collating would change nothing, and nowhere else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from hand_made import alter, hand_made

from experiments.collate.current import is_current
from experiments.collate.join import collate
from experiments.tracking.points import Point
from experiments.tracking.sealed import read_sealed
from experiments.tracking.study import write_plan

EXAMPLES = {"ranking": [{"seed": 7}]}


@pytest.fixture
def points(tmp_path: Path) -> list[Point]:
    """Two points, and a study `s` that was collated of them."""
    points = [hand_made(tmp_path, seed=seed) for seed in (1, 0)]
    plan(points, tmp_path / "s")
    collate(points, tmp_path / "s", log=lambda line: None)
    return points


def plan(points: list[Point], folder: Path, case: str = "a: b", examples: object = None) -> None:
    """List the points of a sweep that starts."""
    write_plan(folder, [(point, [f"case='{case}'"]) for point in points], examples or EXAMPLES)


def test_tables_that_nothing_changes_are_current(points: list[Point], tmp_path: Path) -> None:
    assert is_current(points, tmp_path / "s")
    plan(points, tmp_path / "s")  # the next sweep starts
    assert is_current(points[::-1], tmp_path / "s")
    assert not is_current(points, tmp_path / "another")


def rerun(folder: Path) -> None:
    """Compute a point again, in another attempt."""
    hand_made(folder.parent, seed=1, record={"attempt": 2})


def collated_by_others(folder: Path) -> None:
    """Say that other code made the tables."""
    listed = read_sealed(folder / "study.json")["collated"]
    alter(folder / "study.json", collated={**listed, "made_by": "0" * 64})


def listed_half(folder: Path) -> None:
    """Say what a kill leaves between the two files of a listing: an older one of the two."""
    listed = read_sealed(folder / "study.json")["collated"]
    alter(folder / "study.json", collated={**listed, "commits": ["older"]})


@pytest.mark.parametrize(
    "change",
    [
        rerun,
        collated_by_others,
        listed_half,
        lambda folder: (folder / "runs.json").unlink(),
        lambda folder: (folder / "tables" / "summary.csv").unlink(),
        lambda folder: (folder / "tables" / "summary.csv").write_text("seed\n"),
    ],
)
def test_what_changes_asks_for_new_tables(
    change: Callable[[Path], None], points: list[Point], tmp_path: Path
) -> None:
    change(tmp_path / "s")
    assert not is_current(points, tmp_path / "s")
    collate(points, tmp_path / "s", log=lambda line: None)
    assert is_current(points, tmp_path / "s")


@pytest.mark.parametrize("new", [{"case": "a: c"}, {"examples": {"ranking": [{"seed": 8}]}}])
def test_a_plan_without_its_tables_asks_for_them(
    new: dict[str, object], points: list[Point], tmp_path: Path
) -> None:
    """Of a sweep that was stopped in between: the listing stays the same in the next one."""
    for _ in range(2):
        plan(points, tmp_path / "s", **new)
        assert not is_current(points, tmp_path / "s")


def test_other_points_ask_for_new_tables(points: list[Point], tmp_path: Path) -> None:
    other = hand_made(tmp_path, seed=2)
    assert not is_current([*points, other], tmp_path / "s")
    assert not is_current(points[:1], tmp_path / "s")


def test_a_mixture_of_sources_is_current_where_it_is_allowed(tmp_path: Path) -> None:
    points = [hand_made(tmp_path), hand_made(tmp_path, record={"source": "other"}, seed=1)]
    collate(points, tmp_path / "s", mixed=True)
    assert is_current(points, tmp_path / "s", mixed=True)
    assert not is_current(points, tmp_path / "s")
