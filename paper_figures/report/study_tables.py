"""Tables and figures of the studies in a folder of results, read as they are asked for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from paper_figures.rows import ACTIONS, SAMPLES

# The commands that make what is in the folders of results.
COMMANDS = {"benchmark": "make benchmark"}

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
    """

    folder: Path
    read: dict[tuple[str, str], pd.DataFrame] = field(default_factory=dict)

    def table(self, study: str, name: str, columns: Sequence[str] = ()) -> pd.DataFrame:
        """A table of a study.

        Args:
            study: the study's name.
            name: the table's name.
            columns: what is needed of it.

        Raises:
            Missing: there is no such table, or a column is not in it.
        """
        if (study, name) not in self.read:
            path = self.folder / study / "tables" / f"{name}.csv"
            if not path.is_file():
                raise Missing(study, f"the study `{study}` has no table `{name}` yet")
            self.read[study, name] = pd.read_csv(path)
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
            content = json.loads((self.folder / study / "study.json").read_bytes())["collated"]
            return {key: content[key] for key in _LISTING}
        except (OSError, ValueError, KeyError, TypeError):
            raise Missing(study, f"the study `{study}` does not list what it came from") from None

    def studies(self) -> list[str]:
        """The studies that have tables."""
        return sorted(path.parent.name for path in self.folder.glob("*/tables"))


def command(study: str) -> str:
    """What to type for a study's tables and figures."""
    return COMMANDS.get(study, f"python experiments/run.py -m experiment={study}")


def absent(missing: Missing) -> str:
    """What stands where a part of the report cannot be written."""
    return f"Not there yet: {missing}. `{command(missing.study)}` makes it.\n"


def paper_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of the paper's figures: 9 actions, one start point a cell."""
    return table[(table["actions"] == ACTIONS) & (table["samples"] == SAMPLES)]
