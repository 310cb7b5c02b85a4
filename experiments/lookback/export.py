"""One tidy table of a study, for other programs."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from experiments.lookback.archive import ArchiveError, Facts
from experiments.tracking.files import csv_bytes, read_file

_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # how a cell begins that a spreadsheet computes


def tidy_table(points: Sequence[Facts], measure: str) -> pd.DataFrame:
    """The rows of one measure of finished points, opened by each point's config and origin.

    Raises:
        ArchiveError: a point has no such table.
    """
    tables, fronts = [], []
    for facts in points:
        record, name = facts.record, f"{measure}.csv"
        if name not in record["files"]:
            known = ", ".join(Path(file).stem for file in record["files"] if file.endswith(".csv"))
            raise ArchiveError(f"{measure}: no such table; there are {known}")
        try:
            table = pd.read_csv(io.BytesIO(read_file(facts.point.folder / name)))
        except ValueError as error:
            place = f"{facts.point.folder / name}"
            raise ArchiveError(f"{place} is no table: {error}; run the point again") from None
        front: dict[str, object] = {
            "point": facts.point.identity,
            "state": str(facts.state),
            "source": record["source"],
            "commit": record["git"]["commit"],
            "started": record["started"],
            "seconds": record["seconds"]["total"],
            **{f"config.{key}": value for key, value in facts.config.items()},
        }
        fronts += [front] * len(table)
        tables.append(table)
    return pd.concat([pd.DataFrame(fronts), pd.concat(tables, ignore_index=True)], axis=1)


def file_bytes(table: pd.DataFrame, kind: str) -> bytes:
    """A table as `csv`, in which no text is a formula of a spreadsheet, or `parquet`.

    Raises:
        ArchiveError: what writes parquet is not installed.
    """
    if kind == "csv":
        return csv_bytes(table.rename(columns=_no_formula).map(_no_formula))
    buffer = io.BytesIO()
    try:
        table.to_parquet(buffer, index=False)
    except ImportError:
        raise ArchiveError("parquet needs pyarrow: pip install pyarrow") from None
    return buffer.getvalue()


def _no_formula(cell: object) -> object:
    """A cell that a spreadsheet takes for text, with an apostrophe in front where it would not."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULA) else cell
