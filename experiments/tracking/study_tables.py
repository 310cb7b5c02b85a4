"""The tables of a study for whoever reads them: as the study lists them, or not at all."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from experiments.tracking.files import digest, file_digest, read_file
from experiments.tracking.names import inner_path
from experiments.tracking.study import Study, StudyError, read_study

_TRIES, _PAUSE = 5, 0.2  # while a sweep publishes its tables, which takes a moment [s]


class TableError(Exception):
    """A table that is not as its study lists it; the message names it and what to do."""


def read_tables(folder: Path, names: Iterable[str]) -> dict[str, bytes]:
    """The content of some tables of a study, all of one collation.

    A study without a listing has tables of somebody's own, and nothing to check them against.

    Args:
        folder: the study's.
        names: of the tables, without `.csv`.

    Raises:
        FileNotFoundError: there is no such table.
        TableError: a table, or the study's listing, is not as it was written.
    """
    names = list(names)
    for _ in range(_TRIES - 1):
        try:
            return _read_once(folder, names)
        except (TableError, FileNotFoundError):
            if not _is_publishing(folder):
                break
            time.sleep(_PAUSE)
    return _read_once(folder, names)


@dataclass(frozen=True)
class TableChanges:
    """How the tables of a study differ from what it lists.

    Attributes:
        missing: names of files that are not there.
        damaged: what is wrong with others, a line each.
    """

    missing: tuple[str, ...]
    damaged: tuple[str, ...]


def table_changes(study: Study) -> TableChanges:
    """How the tables of a study differ from what it lists."""
    missing, damaged = [], []
    for name, before in (study.collated.tables if study.collated else {}).items():
        try:
            if file_digest(inner_path(study.folder, "tables", name)) != before:
                damaged.append(f"table {name} was changed after it was written")
        except FileNotFoundError:
            missing.append(name)
        except OSError as error:
            damaged.append(f"table {name} cannot be read: {error.strerror}")
    return TableChanges(tuple(missing), tuple(damaged))


def _is_publishing(folder: Path) -> bool:
    """Whether tables that are not published yet lie beside those of a study."""
    return any(folder.glob(".tables-*"))


def _read_once(folder: Path, names: Iterable[str]) -> dict[str, bytes]:
    """The tables, and errors as of `read_tables`."""
    try:
        study = read_study(folder)
    except StudyError as error:
        raise TableError(f"{error}, and none of its tables is used until then") from None
    listed = study.collated.tables if study and study.collated else None
    contents = {}
    for name in names:
        try:
            path = inner_path(folder, "tables", f"{name}.csv")
            contents[name] = read_file(path)
        except FileNotFoundError:
            raise
        except OSError as error:
            raise TableError(f"{error.filename}: {error.strerror}") from None
        if listed is not None and digest(contents[name]) != listed.get(path.name):
            raise TableError(
                f"{path} is not as its study lists it; run the study again to write it anew"
            )
    return contents
