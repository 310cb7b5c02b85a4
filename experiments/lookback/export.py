"""One tidy table of a study, for other programs."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from experiments.lookback.archive import ArchiveError, KeptPoint
from experiments.tracking.files import csv_bytes


def tidy_table(points: Sequence[KeptPoint], measure: str) -> pd.DataFrame:
    """The rows of one measure of finished points, opened by each point's config and origin.

    Raises:
        ArchiveError: a point has no such table.
    """
    frames, front = [], []
    for point in points:
        record, name = point.content, f"{measure}.csv"
        if name not in record["files"]:
            known = ", ".join(Path(file).stem for file in record["files"] if file.endswith(".csv"))
            raise ArchiveError(f"{measure}: no such table; there are {known}")
        rows = pd.read_csv(point.point.folder / name)
        opening: dict[str, object] = {
            "point": point.identity,
            "state": str(point.known_state),
            "source": record["source"],
            "commit": record["git"]["commit"],
            "started": record["started"],
            "seconds": record["seconds"]["total"],
            **{f"config.{key}": value for key, value in point.config.items()},
        }
        front += [opening] * len(rows)
        frames.append(rows)
    return pd.concat([pd.DataFrame(front), pd.concat(frames, ignore_index=True)], axis=1)


def file_bytes(table: pd.DataFrame, kind: str) -> bytes:
    """A table as `csv` or `parquet`.

    Raises:
        ArchiveError: what writes parquet is not installed.
    """
    if kind == "csv":
        return csv_bytes(table)
    buffer = io.BytesIO()
    try:
        table.to_parquet(buffer, index=False)
    except ImportError:
        raise ArchiveError("parquet needs pyarrow: pip install 'mlci[parquet]'") from None
    return buffer.getvalue()
