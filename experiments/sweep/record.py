"""What an attempt leaves in the point's folder: its tables and record, or its failure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from experiments.config.settings import Settings
from experiments.tracking.environment import environment, peak_memory
from experiments.tracking.files import digest, read_file, replace_file
from experiments.tracking.points import Point
from experiments.tracking.store import Store
from experiments.tracking.trees import plain

if TYPE_CHECKING:
    import pandas as pd


def write_result(
    point: Point,
    settings: Settings,
    tables: Mapping[str, pd.DataFrame],
    store: Store,
    attempt: Mapping[str, Any],
) -> None:
    """Write the tables, then the record, which makes them count.

    Args:
        point: the point.
        settings: what it was computed from.
        tables: its tables by name.
        store: the store that it used, which knows stages and times.
        attempt: number and start of the attempt.
    """
    from experiments.point.tables import table_bytes
    from experiments.tracking.tables import rounded

    files = {"log.txt": digest(read_file(point.folder / "log.txt"))}
    for name, frame in sorted(tables.items()):
        data = table_bytes(name, frame, settings)
        files[f"{name}.csv"] = digest(data)
        replace_file(point.folder / f"{name}.csv", data)
    row = rounded(tables["summary"]).to_dict("records")[0] if "summary" in tables else {}
    record = {
        "identity": point.identity,
        "source": point.source,
        "config": plain(settings),
        "seed": settings.seed,
        "summary": {str(name): _finite(value) for name, value in row.items()},
        "files": files,
        "stages": store.keys,
        "attempt": attempt["attempt"],
        "started": attempt["started"],
        "seconds": {stage: round(spent, 3) for stage, spent in store.seconds.items()},
        "peak_memory_mb": peak_memory(),
        **environment(point.results),
    }
    point.write_note("record", record)


def write_failure(point: Point, reason: str, error: str, traceback: str, attempt: int) -> None:
    """Write how an attempt, by its number, ended, as far as there is room on the disk.

    Args:
        point: the point.
        reason: "raised", "timeout" or "died".
        error: on one line.
        traceback: of the error, or where the process was.
        attempt: its number.
    """
    note = point.note("attempt") or {}
    started = note.get("started") if note.get("attempt") == attempt else None
    spent = datetime.now(UTC) - datetime.fromisoformat(started) if started else None
    failure = {
        "identity": point.identity,
        "source": point.source,
        "attempt": attempt,
        "reason": reason,
        "error": error,
        "traceback": traceback,
        "started": started,
        "seconds": spent and round(spent.total_seconds(), 3),
    }
    with suppress(OSError):
        point.write_note("failure", failure)
        (point.folder / "attempt.json").unlink(missing_ok=True)


def _finite(value: Any) -> Any:
    """The value, or None for NaN and infinities, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
