"""Tables as CSV: one a measure and point, then one a measure for the whole study.

Collating copies rows as text, so a study's table holds exactly the numbers that points wrote. What
`experiments.collate.intervals` makes of these tables stands beside them.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import pandas as pd

from experiments.collate.cases import case_table
from experiments.collate.examples import example_tables
from experiments.collate.intervals import study_tables
from experiments.collate.reliability import reliability
from experiments.collate.settings_of import settings_of
from experiments.point.tables import opening_columns
from experiments.point.truth_tables import TRUTH_TABLES
from experiments.tracking.files import csv_bytes, digest, replacing
from experiments.tracking.study import collated, whole_study, write_collated
from experiments.tracking.trees import flatten

if TYPE_CHECKING:
    from experiments.tracking.points import Point


class CollateError(Exception):
    """Points that cannot stand in one table; the message names them."""


def collate(points: Sequence[Point], folder: Path, *, mixed: bool = False) -> list[Path]:
    """Write one table a measure for all points of a study, and list what they came from.

    Rows are ordered by the points' settings, then as each point wrote them. A setting that
    differs between points, and that the usual columns do not tell apart, becomes a column.

    Args:
        points: the points, in any order; each finished.
        folder: the study's folder.
        mixed: whether points may come from different versions of the source.

    Returns:
        the tables' paths.

    Raises:
        CollateError: a point that is not finished, or whose source or columns differ.
    """
    records = {point.identity: _read_record(point) for point in points}
    by_source: dict[str, list[str]] = {}
    for identity, record in records.items():
        by_source.setdefault(record["source"], []).append(identity)
    if len(by_source) > 1 and not mixed:
        raise CollateError(_describe_mixture(by_source))
    flat = {point.identity: flatten(dict(point.config)) for point in points}
    ordered = sorted(
        points,
        key=lambda point: (
            _sort_key(settings_of(point).columns),
            _sort_key(flat[point.identity]),
            point.identity,
        ),
    )
    names = sorted({name for record in records.values() for name in record["files"]} - {"log.txt"})
    alone = [[point] for point in ordered]
    alone_extra = _extra_columns(alone, "", flat)
    digests, joined = {}, {}
    with ExitStack() as written:  # no table takes its place unless all are whole
        for name in names:
            groups, extra = alone, alone_extra
            if Path(name).stem in TRUTH_TABLES:
                same: dict[str, list[Point]] = {}
                for point in ordered:
                    content = records[point.identity]["files"].get(name, "")
                    same.setdefault(content, []).append(point)
                groups = list(same.values())
                extra = _extra_columns(groups, Path(name).stem, flat)
            file = written.enter_context(replacing(folder / "tables" / name))
            first = [(group[0], records[group[0].identity]["files"].get(name)) for group in groups]
            digests[name] = _join(file, name, first, extra, flat)
            file.flush()
            joined[Path(name).stem] = Path(file.name)
        whole = {**example_tables(ordered), **study_tables(joined)}
        if "calibration" in joined:
            whole["reliability"] = reliability(pd.read_csv(joined["calibration"]))
        plan = whole_study(folder)
        listed = [point.identity for point in ordered]
        cases = case_table(joined["summary"], listed, plan.points if plan else {})
        if cases is not None:
            whole["cases"] = cases
        for name, frame in whole.items():
            data = csv_bytes(frame)
            written.enter_context(replacing(folder / "tables" / f"{name}.csv")).write(data)
            digests[f"{name}.csv"] = digest(data)
    _forget_others(folder, digests)
    records = {point.identity: records[point.identity] for point in ordered}
    write_collated(folder, collated(records, digests))
    return [folder / "tables" / name for name in sorted(digests)]


def _forget_others(folder: Path, tables: Mapping[str, str]) -> None:
    """Remove the tables that the study listed before and does not have any more."""
    before = whole_study(folder)
    for name in before.collated.tables if before and before.collated else ():
        if name not in tables:
            (folder / "tables" / name).unlink(missing_ok=True)


def _read_record(point: Point) -> dict[str, Any]:
    """A point's record; its files are checked when they are read."""
    try:
        record: dict[str, Any] = json.loads((point.folder / "record.json").read_bytes())
        if record["identity"] == point.identity:
            return record
    except (OSError, ValueError, KeyError, TypeError):
        pass
    raise CollateError(f"point {point.identity} is not finished: {point.folder}")


def _describe_mixture(by_source: Mapping[str, Sequence[str]]) -> str:
    """Which points come from which version of the source, most first."""
    lines = [
        f"  {source[:12]}: {len(points)} points, such as {points[0]}"
        for source, points in sorted(by_source.items(), key=lambda item: -len(item[1]))
    ]
    return "\n".join(
        [
            "these points come from different versions of the source, and no table is written; "
            "run the sweep again, or tell it to mix them with sweep.mix_sources=true:",
            *lines,
        ]
    )


def _join(
    file: BinaryIO,
    name: str,
    points: Sequence[tuple[Point, str | None]],
    extra: Sequence[str],
    flat: Mapping[str, dict[str, Any]],
) -> str:
    """Write one table of all points, with the extra columns in front; returns its digest.

    Each point comes with the digest that its own table must have.
    """
    header, seen = None, hashlib.sha256()
    for point, expected in points:
        path = point.folder / name
        if not expected or not path.exists():
            raise CollateError(f"point {point.identity} has no table {name}: {path}")
        data = path.read_bytes()
        if digest(data) != expected:
            raise CollateError(f"{path} is not as its point wrote it; run the sweep again")
        first, _, rows = data.partition(b"\n")
        values = _csv_row([flat[point.identity].get(key, "") for key in extra])
        if values and rows:
            rows = values + rows[:-1].replace(b"\n", b"\n" + values) + b"\n"
        if header is None:
            header, rows = first, _csv_row(extra) + first + b"\n" + rows
        elif first != header:
            raise CollateError(f"the columns of {path} are {first.decode()}, not {header.decode()}")
        file.write(rows)
        seen.update(rows)
    return seen.hexdigest()


def _csv_row(values: Sequence[Any]) -> bytes:
    """Values as the start of a CSV line, up to and with the comma before the next."""
    if not values:
        return b""
    text = io.StringIO()
    csv.writer(text, lineterminator=",").writerow(values)
    return text.getvalue().encode()


def _extra_columns(
    groups: Sequence[Sequence[Point]], measure: str, flat: Mapping[str, dict[str, Any]]
) -> list[str]:
    """Dotted keys, in order, that are needed to tell groups of points with equal rows apart."""

    def varies(key: str, group: Sequence[Point]) -> bool:
        return len({flat[point.identity].get(key) for point in group}) > 1

    keys = dict.fromkeys(key for group in groups for key in flat[group[0].identity])
    known: list[tuple[Any, ...]] = [
        tuple(opening_columns(measure, settings_of(group[0])).values()) for group in groups
    ]
    extra = []
    several = [group for group in groups if len(group) > 1]
    # A key that varies inside a group is no reason for its rows, unless there is no other.
    for key in sorted(keys, key=lambda key: any(varies(key, group) for group in several)):
        told: dict[tuple[Any, ...], list[Point]] = {}
        for values, group in zip(known, groups, strict=True):
            told.setdefault(values, []).append(group[0])
        if len(told) == len(groups):
            break
        if any(varies(key, alike) for alike in told.values()):
            extra.append(key)
            known = [
                (*values, flat[group[0].identity].get(key))
                for values, group in zip(known, groups, strict=True)
            ]
    return extra


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
