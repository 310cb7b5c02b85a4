"""Tables and figures of the studies in a folder of results, read as they are asked for."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.tracking.files import digest
from experiments.tracking.forms import study_fault
from experiments.tracking.study import StudyError, read_study
from experiments.tracking.study_tables import TableError, read_tables
from experiments.tracking.trees import plain
from paper_figures.rows import ACTIONS, SAMPLES

# The commands that make what is in the folders of results.
COMMANDS = {
    "benchmark": "make benchmark",
    "dimensions": "python -m tests.benchmark.dimensions",
    "shortest_ways": "python -m tests.benchmark.shortest_ways",
}

# What is read of a study's listing.
_LISTING = ("points", "sources", "commits", "dirty", "started", "seconds", "peak_memory_mb")
_LISTING += ("machines", "versions")


class Missing(Exception):
    """A part of the report cannot be written.

    Attributes:
        study: what has to be run for it.
    """

    def __init__(self, study: str, what: str) -> None:
        super().__init__(what)
        self.study = study


@dataclass(frozen=True)
class Results:
    """A folder of results.

    Attributes:
        folder: `results`, which has a folder for each study.
        read: the tables that were read so far, by study and name.
        digests: sha256 of each of them, by study and file.
        damage: which tables and figures are not as they were written.
    """

    folder: Path
    read: dict[tuple[str, str], pd.DataFrame] = field(default_factory=dict)
    digests: dict[str, str] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)

    def table(self, study: str, name: str, columns: Sequence[str] = ()) -> pd.DataFrame:
        """A table of a study.

        Args:
            study: the study's name.
            name: the table's name.
            columns: what is needed of it.

        Raises:
            Missing: there is no such table, it is not as it was written, or a column is not in it.
        """
        if (study, name) not in self.read:
            try:
                content = read_tables(self.folder / study, [name])[name]
            except FileNotFoundError:
                raise Missing(study, f"the study `{study}` has no table `{name}` yet") from None
            except TableError as error:
                self.damage.append(str(error))
                reason = f"the table `{name}` of the study `{study}` is not as it was written"
                raise Missing(study, reason) from None
            self.digests[f"{study}/tables/{name}.csv"] = digest(content)
            self.read[study, name] = pd.read_csv(io.BytesIO(content))
        table = self.read[study, name]
        if lacking := [column for column in columns if column not in table]:
            raise Missing(
                study,
                f"the table `{name}` of the study `{study}` has no column {', '.join(lacking)}",
            )
        return table

    def listing(self, study: str) -> dict[str, Any]:
        """What the study's tables came from.

        Raises:
            Missing: the study does not tell.
        """
        try:
            listed = read_study(self.folder / study)
            if listed is not None and (fault := study_fault(listed)):
                raise StudyError(f"{self.folder / study / 'study.json'} is no listing: {fault}")
        except StudyError as error:
            self.damage.append(str(error))
            listed = None
        if listed is None or listed.collated is None or not listed.collated.points:
            raise Missing(study, f"the study `{study}` does not list what it came from")
        content = plain(listed.collated)
        return {key: content[key] for key in _LISTING}

    def studies(self) -> list[str]:
        """The studies that have tables, or list some."""
        paths = [*self.folder.glob("*/tables"), *self.folder.glob("*/study.json")]
        return sorted({path.parent.name for path in paths})


def command(study: str) -> str:
    """What to type for a study's tables and figures."""
    return COMMANDS.get(study, f"python experiments/run.py -m experiment={study}")


def absent(missing: Missing) -> str:
    """What stands where a part of the report cannot be written."""
    return f"Not there yet: {missing}. `{command(missing.study)}` makes it.\n"


def paper_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of the paper's figures: 9 actions, one start point a cell."""
    return table[(table["actions"] == ACTIONS) & (table["samples"] == SAMPLES)]
