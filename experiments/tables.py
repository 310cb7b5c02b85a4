"""Tables as CSV: one a measure and point, then one a measure for the whole study.

Collating copies rows as text, so a study's table holds exactly the numbers that points wrote.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiments.measures import TRUTH_TABLES
from experiments.schema import plain
from experiments.settings import Settings
from experiments.store import digest, replace_file

if TYPE_CHECKING:
    from experiments.record import Point


class CollateError(Exception):
    """Points that cannot stand in one table; the message names them."""


def opening_columns(measure: str, settings: Settings) -> dict[str, str | int | float]:
    """The values that open every row of a point's table."""
    columns = settings.columns
    return {"truth": columns["truth"]} if measure in TRUTH_TABLES else columns


def table_bytes(measure: str, frame: pd.DataFrame, settings: Settings) -> bytes:
    """A point's table as CSV, every row opened by the point's own values, floats exact."""
    columns = opening_columns(measure, settings)
    kept = [name for name in frame.columns if name not in columns]
    opened = frame[kept].copy()
    for place, (name, value) in enumerate(columns.items()):
        opened.insert(place, name, value)
    return csv_bytes(opened)


def csv_bytes(frame: pd.DataFrame) -> bytes:
    """A table as CSV, floats exact."""
    text: str = frame.to_csv(index=False, lineterminator="\n")
    return text.encode()


def collate(points: Sequence[Point], study: Path) -> list[Path]:
    """Write one table a measure for all points of a study, and the list of those points.

    Rows are ordered by the points' settings, then as each point wrote them. A setting that
    differs between points, and that the usual columns do not tell apart, becomes a column.

    Args:
        points: the points, in any order; each finished, with one version of the source.
        study: the study's folder.

    Returns:
        the tables' paths.

    Raises:
        CollateError: a point that is not finished, or whose source or columns differ.
    """
    records = {}
    for point in points:
        record = point.record()
        if record is None:
            raise CollateError(f"point {point.identity} is not finished: {point.folder}")
        records[point.identity] = record
    sources = {record["source"] for record in records.values()}
    if len(sources) > 1:
        raise CollateError(
            "these points come from different versions of the source; run the sweep again: "
            + ", ".join(f"{name} ({record['source'][:8]})" for name, record in records.items())
        )
    flat = {point.identity: _flatten(plain(point.settings)) for point in points}
    ordered = sorted(
        points,
        key=lambda point: (
            _sort_key(point.settings.columns),
            _sort_key(flat[point.identity]),
            point.identity,
        ),
    )
    names = sorted({name for record in records.values() for name in record["files"]} - {"log.txt"})
    written, digests = [], {}
    for name in names:
        measure = Path(name).stem
        same: dict[str, list[Point]] = {}
        for point in ordered:
            content = records[point.identity]["files"].get(name, "")
            alike = content if measure in TRUTH_TABLES else point.identity
            same.setdefault(alike, []).append(point)
        groups = list(same.values())
        extra = _extra_columns(groups, measure, flat)
        data = _join([group[0] for group in groups], name, extra, flat)
        replace_file(study / "tables" / name, data)
        written.append(study / "tables" / name)
        digests[name] = digest(data)
    listing = {
        "source": sources.pop(),
        "points": [point.identity for point in ordered],
        "tables": digests,
    }
    replace_file(study / "study.json", json.dumps(listing, indent=1).encode() + b"\n")
    return written


def _join(
    ordered: Sequence[Point], name: str, extra: Sequence[str], flat: Mapping[str, dict[str, Any]]
) -> bytes:
    """One table of all points, with the extra columns in front."""
    text = io.StringIO()
    header = None
    for point in ordered:
        path = point.folder / name
        try:
            first, rows = path.read_text().split("\n", 1)
        except FileNotFoundError:
            raise CollateError(f"point {point.identity} has no table {name}: {path}") from None
        if header is None:
            header = first
            text.write(_csv_row(extra) + header + "\n")
        elif first != header:
            raise CollateError(f"the columns of {path} are {first}, not {header}")
        values = _csv_row([flat[point.identity].get(key, "") for key in extra])
        text.writelines(f"{values}{row}\n" for row in rows.splitlines())
    return text.getvalue().encode()


def _csv_row(values: Sequence[Any]) -> str:
    """Values as the start of a CSV line, up to and with the comma before the next."""
    if not values:
        return ""
    text = io.StringIO()
    csv.writer(text, lineterminator=",").writerow(values)
    return text.getvalue()


def _extra_columns(
    groups: Sequence[Sequence[Point]], measure: str, flat: Mapping[str, dict[str, Any]]
) -> list[str]:
    """Dotted keys, in order, that are needed to tell groups of points with equal rows apart."""

    def varies(key: str, group: Sequence[Point]) -> bool:
        return len({flat[point.identity].get(key) for point in group}) > 1

    keys = dict.fromkeys(key for group in groups for key in flat[group[0].identity])
    known: list[tuple[Any, ...]] = [
        tuple(opening_columns(measure, group[0].settings).values()) for group in groups
    ]
    extra = []
    # A key that varies inside a group is no reason for its rows, unless there is no other.
    for key in sorted(keys, key=lambda key: any(varies(key, group) for group in groups)):
        told: dict[tuple[Any, ...], list[Point]] = {}
        for values, group in zip(known, groups, strict=True):
            told.setdefault(values, []).append(group[0])
        if any(varies(key, alike) for alike in told.values()):
            extra.append(key)
            known = [
                (*values, flat[group[0].identity].get(key))
                for values, group in zip(known, groups, strict=True)
            ]
    return extra


def _flatten(tree: Any, prefix: str = "") -> dict[str, Any]:
    """Scalars by dotted key, in order; a list is one value, spelt as JSON."""
    if not isinstance(tree, dict):
        return {prefix: json.dumps(tree) if isinstance(tree, list) else tree}
    flat = {}
    for key, value in tree.items():
        flat.update(_flatten(value, f"{prefix}.{key}" if prefix else key))
    return flat


def _sort_key(values: Mapping[str, Any]) -> list[tuple[int, float, str]]:
    """Sorts points by their values in turn: nothing, then numbers by size, then words."""
    return [
        (0, 0.0, "")
        if value is None
        else (1, float(value), "")
        if isinstance(value, int | float)
        else (2, 0.0, str(value))
        for value in values.values()
    ]
