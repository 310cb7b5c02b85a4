"""Tables of a study, as it lists them or not at all."""

import os
from pathlib import Path

import pytest
from hand_made import hand_made

from experiments.collate.join import collate
from experiments.tracking.study import read_study
from experiments.tracking.study_tables import TableError, read_tables, table_changes


@pytest.fixture
def study(tmp_path: Path) -> Path:
    collate([hand_made(tmp_path)], tmp_path / "s")
    return tmp_path / "s"


def test_tables_are_read_as_they_were_written(study: Path) -> None:
    table = study / "tables" / "summary.csv"
    assert read_tables(study, ["summary"]) == {"summary": table.read_bytes()}
    with pytest.raises(FileNotFoundError):
        read_tables(study, ["none"])


@pytest.mark.parametrize("harm", ["cut", "link", "pipe", "listing", "own"])
def test_a_table_that_is_not_as_listed_is_refused(harm: str, study: Path) -> None:
    table, name = study / "tables" / "summary.csv", "summary"
    data = table.read_bytes()
    if harm == "cut":
        table.write_bytes(data[: len(data) // 2])
    elif harm == "link":
        (study / "elsewhere").write_bytes(data)
        table.unlink()
        table.symlink_to(study / "elsewhere")
    elif harm == "pipe":
        table.unlink()
        os.mkfifo(table)
    elif harm == "listing":
        (study / "study.json").write_text("{")
    else:
        name = "mine"
        (study / "tables" / "mine.csv").write_bytes(data)
    with pytest.raises(TableError):
        read_tables(study, [name])
    if harm in ("cut", "link", "pipe"):
        (told,) = table_changes(read_study(study)).damaged
        assert told.startswith("table summary.csv")


def test_tables_that_nobody_lists_are_somebodys_own(tmp_path: Path) -> None:
    (tmp_path / "s" / "tables").mkdir(parents=True)
    (tmp_path / "s" / "tables" / "a.csv").write_bytes(b"a\n")
    assert read_tables(tmp_path / "s", ["a"]) == {"a": b"a\n"}
