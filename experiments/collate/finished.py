"""A finished point as collating sees it: its record, and its tables with every value as spelt."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.terminal import counted
from experiments.tracking.files import digest, read_file
from experiments.tracking.points import Point, system_module
from experiments.tracking.trees import flatten

if TYPE_CHECKING:
    import pandas as pd

LAST_OPENING = "seed"  # the last of the columns that open a point's tables


class CollateError(Exception):
    """Points that cannot stand in one table; the message names them."""


@dataclass(frozen=True, eq=False)
class FinishedPoint:
    """A point that finished.

    Attributes:
        identity: its name.
        folder: where its tables are.
        record: what it wrote of itself.
    """

    identity: str
    folder: Path
    record: Mapping[str, Any]

    @classmethod
    def read(cls, point: Point) -> FinishedPoint:
        """A point by its record; its tables are checked when they are read.

        Raises:
            CollateError: the point did not finish.
        """
        record = point.note("record")
        if record is None:
            raise CollateError(f"point {point.identity} is not finished: {point.folder}")
        return cls(point.identity, point.folder, record)

    @property
    def tables(self) -> list[str]:
        """Names of the tables that it wrote."""
        return [Path(name).stem for name in self.record["files"] if name.endswith(".csv")]

    @cached_property
    def config(self) -> dict[str, Any]:
        """Its config by dotted keys."""
        return flatten(self.record["config"])

    @cached_property
    def opening(self) -> dict[str, str]:
        """The columns that open its tables, up to the seed, with its values."""
        # One row, for which pandas would take milliseconds to begin.
        row = next(csv.DictReader(io.StringIO(self.content("summary").decode())))
        names = list(row)
        return {name: row[name] for name in names[: names.index(LAST_OPENING) + 1]}

    def columns(self, name: str) -> list[str]:
        """Names of the columns of a table; errors as of `content`."""
        head, _, _ = self.content(name).decode().partition("\n")
        return next(csv.reader([head]))

    def table(self, name: str) -> pd.DataFrame:
        """A table of strings; errors as of `content`."""
        import pandas as pd

        # As objects: pandas' own type for strings is slower to read and to write.
        return pd.read_csv(io.BytesIO(self.content(name)), dtype=object, keep_default_na=False)

    def content(self, name: str) -> bytes:
        """A table as the point wrote it.

        Raises:
            CollateError: there is none, or it is not as the point wrote it.
        """
        path = self.folder / f"{name}.csv"
        written = self.table_digest(name)
        if not written or not path.exists():
            raise CollateError(f"point {self.identity} has no table {path.name}: {path}")
        data = read_file(path)
        if digest(data) != written:
            raise CollateError(f"{path} is not as its point wrote it; run the sweep again")
        return data

    def table_digest(self, name: str) -> str:
        """sha256 of a table as the point wrote it; empty if it wrote none."""
        return str(self.record["files"].get(f"{name}.csv", ""))


def refuse_mixture(points: Sequence[FinishedPoint]) -> None:
    """Raise unless all points of a system come from one version of the source; say which do not."""
    by_source: dict[str, list[str]] = {}
    versions: dict[str, set[str]] = {}
    for point in points:
        by_source.setdefault(point.record["source"], []).append(point.identity)
        module = system_module(point.record["config"])
        versions.setdefault(module, set()).add(point.record["source"])
    if all(len(each) == 1 for each in versions.values()):
        return
    lines = [
        f"  {source[:12]}: {counted(len(identities), 'point')}, such as {identities[0]}"
        for source, identities in sorted(by_source.items(), key=lambda item: -len(item[1]))
    ]
    raise CollateError(
        "\n".join(
            [
                "these points come from different versions of the source, and no table is "
                "written; run the sweep again, or tell it to mix them with "
                "sweep.mix_sources=true:",
                *lines,
            ]
        )
    )
