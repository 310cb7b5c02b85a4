"""Collating: the tables of a study's points, joined into one table a measure for the whole study.

Values are copied as they are spelt, so a study's table holds exactly the numbers that points wrote.
Beside them stand the tables that are made of these: intervals, reliability, examples and cases.
"""

from __future__ import annotations

import csv
import io
import math
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.collate.baselines import baseline_differences
from experiments.collate.cases import case_names, case_table
from experiments.collate.chosen_tasks import chosen_tasks, early_overlap, unfound
from experiments.collate.current import made_of
from experiments.collate.evidence_kinds import evidence_kinds
from experiments.collate.examples import example_tables
from experiments.collate.finished import CollateError, FinishedPoint, refuse_mixture
from experiments.collate.intervals import study_tables
from experiments.collate.reliability import reliability
from experiments.tracking.files import (
    csv_bytes,
    digest,
    exchange_folders,
    part_of,
    read_file,
    replace_file,
    replacing,
)
from experiments.tracking.names import inner_path
from experiments.tracking.points import Point
from experiments.tracking.study import Study, collated, whole_study, write_collated
from experiments.tracking.tables import agree, rounded


def collate(
    points: Sequence[Point],
    folder: Path,
    *,
    mixed: bool = False,
    log: Callable[[str], None] = print,
) -> list[Path]:
    """Write one table a measure for all points of a study, and list what they came from.

    Rows are ordered by the points' settings, then as each point wrote them. A setting that
    differs between points, and that the usual columns do not tell apart, becomes a column. A table
    that is there already, and agrees with the new one but for rounding, stays as it is.

    Args:
        points: the points, in any order; each finished.
        folder: the study's folder.
        mixed: whether points may come from different versions of the source.
        log: is told which of the study's examples are missing, a line each.

    Returns:
        the tables' paths.

    Raises:
        CollateError: a point that is not finished, or whose source or columns differ.
    """
    finished = sorted(map(FinishedPoint.read, points), key=_order)
    if not mixed:
        refuse_mixture(finished)
    study = whole_study(folder)
    tables = inner_path(folder.parent, folder.name, "tables")
    new = part_of(tables)  # a folder, which takes the place of the old one once all are whole
    former = study.collated.tables if study and study.collated else {}
    digests: dict[str, str] = {}
    kept: list[str] = []

    def write(name: str, parts: Iterable[bytes]) -> Path:
        """Write a table, unless the one that is there says the same; returns its path."""
        path = new / f"{name}.csv"
        written = _write(path, parts)
        digests[path.name] = _keep(path, tables / path.name, former.get(path.name)) or written
        if digests[path.name] != written:
            kept.append(path.name)
        return path

    try:
        names = sorted({name for point in finished for name in point.tables})
        joined = {name: write(name, joined_parts(name, finished)) for name in names}
        for name, frame in _made_tables(finished, joined, study, log).items():
            write(name, [csv_bytes(rounded(frame))])
        _publish(new, tables, set(former))
        records = {point.identity: point.record for point in finished}
        write_collated(folder, collated(records, digests, kept, made_of(records, study)))
    finally:
        shutil.rmtree(new, ignore_errors=True)
    return [tables / name for name in sorted(digests)]


def joined_parts(name: str, points: Sequence[FinishedPoint]) -> Iterable[bytes]:
    """The header of a table, then its rows, a part for each point.

    A table that opens with fewer columns than the others, such as one of the truth alone, is the
    same for many points; of those that have it alike the first stands for all. Where points are of
    several systems a table has the columns of each, and no value in those of the others.

    Args:
        name: the table.
        points: the points, in the order of their rows.

    Raises:
        CollateError: a point lacks the table, or has other columns than the first.
    """
    columns = points[0].columns(name)
    if several := len({_system(point) for point in points}) > 1:
        columns = list(dict.fromkeys(each for point in points for each in point.columns(name)))
    opening = list(takewhile(points[0].opening.__contains__, columns))
    groups = [[point] for point in points]
    if len(opening) < len(points[0].opening):
        by_content: dict[str, list[FinishedPoint]] = {}
        for point in points:
            by_content.setdefault(point.table_digest(name), []).append(point)
        groups = list(by_content.values())
    extra = _extra_columns(groups, opening)
    yield csv_bytes(pd.DataFrame(columns=[*extra, *columns]))
    for point, *_ in groups:
        front = {key: point.config.get(key, "") for key in extra}
        own = point.columns(name)
        if several and own != columns:
            yield _filled(point, name, front, columns)
            continue
        if own != columns:
            raise CollateError(
                f"the columns of {point.folder / name}.csv are {','.join(own)}, "
                f"not {','.join(columns)}"
            )
        yield _opened(point, name, front)


def _system(point: FinishedPoint) -> tuple[Any, ...]:
    """The system of a point: its class and arguments, which may change what its states are."""
    return tuple(value for key, value in point.config.items() if key.startswith("system."))


def _filled(
    point: FinishedPoint, name: str, front: Mapping[str, Any], columns: Sequence[str]
) -> bytes:
    """The rows of a point's table with the columns of all, empty where it has none."""
    table = point.table(name).reindex(columns=list(columns), fill_value="")
    return csv_bytes(pd.DataFrame({**front, **table}, index=table.index), header=False)


def _opened(point: FinishedPoint, name: str, front: Mapping[str, Any]) -> bytes:
    """The rows of a point's table as it wrote them, each opened by some values."""
    _, _, rows = point.content(name).partition(b"\n")
    if not front:
        return rows
    if b'"' in rows:  # a row may have several lines
        table = point.table(name)
        return csv_bytes(pd.DataFrame({**front, **table}, index=table.index), header=False)
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow([*front.values(), ""])  # ends with a comma
    opening = text.getvalue().encode()
    return b"".join(opening + row for row in rows.splitlines(keepends=True))


def _made_tables(
    points: Sequence[FinishedPoint],
    joined: Mapping[str, Path],
    study: Study | None,
    log: Callable[[str], None],
) -> dict[str, pd.DataFrame]:
    """The tables that are made of those of the points."""
    names = case_names(study.points if study else {})
    examples = study.examples if study else {}
    made = {**example_tables(points, examples, names, log), **study_tables(joined)}
    if "calibration" in joined:
        made["reliability"] = reliability(pd.read_csv(joined["calibration"]))
    if "evidence" in joined:
        made["evidence_kinds"] = evidence_kinds(pd.read_csv(joined["evidence"]))
    if "baselines" in joined:
        made["baseline_differences"] = baseline_differences(pd.read_csv(joined["baselines"]))
    if "next_task" in joined:
        table = pd.read_csv(joined["next_task"])
        if len(table):
            made["chosen_tasks"], made["unfound"] = chosen_tasks(table), unfound(table)
            made["early_overlap"] = early_overlap(table)
    if "dynamics" in joined:
        from experiments.collate.success_rule import success_tables  # knows mlci: not light

        made |= success_tables(pd.read_csv(joined["dynamics"]))
    cases = case_table(joined["summary"], [point.identity for point in points], names)
    return made if cases is None else {**made, "cases": cases}


def _write(path: Path, parts: Iterable[bytes]) -> str:
    """Write a table; returns its digest."""
    with replacing(path) as file:
        for part in parts:
            file.write(part)
        file.flush()
        return digest(Path(file.name).read_bytes())


def _keep(new: Path, old: Path, listed: str | None) -> str | None:
    """Take the table that is there for a new one that agrees with it; returns its digest, or None.

    Args:
        new: where the new table is.
        old: where the one that is there may be.
        listed: what the study lists as the digest of that; one that has changed since is not kept.
    """
    try:
        before = read_file(old)
    except OSError:
        return None
    if digest(before) != listed or not agree(before, new.read_bytes()):
        return None
    replace_file(new, before)
    return listed


def _publish(new: Path, tables: Path, former: set[str]) -> None:
    """Let a folder of new tables and that of the old ones change names.

    What lies among the old ones and is nobody's table, such as a file of a user's, is kept.

    Args:
        new: where the new tables are; afterwards the old ones.
        tables: where a study's tables are.
        former: the tables that the study listed before.
    """
    exchange_folders(new, tables)
    for path in new.iterdir() if new.exists() else ():
        if path.name not in former and not (tables / path.name).exists():
            path.rename(tables / path.name)


def _extra_columns(groups: Sequence[Sequence[FinishedPoint]], opening: Sequence[str]) -> list[str]:
    """Dotted keys, in order, that tell apart groups of points with the same opening values."""

    def varies(key: str, points: Sequence[FinishedPoint]) -> bool:
        return len({point.config.get(key) for point in points}) > 1

    keys = dict.fromkeys(key for group in groups for key in group[0].config)
    values: list[tuple[Any, ...]] = [
        tuple(group[0].opening[name] for name in opening) for group in groups
    ]
    extra = []
    several = [group for group in groups if len(group) > 1]
    # A key that varies inside a group is no reason for its rows, unless there is no other.
    for key in sorted(keys, key=lambda key: any(varies(key, group) for group in several)):
        alike: dict[tuple[Any, ...], list[FinishedPoint]] = {}
        for value, group in zip(values, groups, strict=True):
            alike.setdefault(value, []).append(group[0])
        if len(alike) == len(groups):
            break
        if any(varies(key, points) for points in alike.values()):
            extra.append(key)
            values = [
                (*value, group[0].config.get(key))
                for value, group in zip(values, groups, strict=True)
            ]
    return extra


def _order(point: FinishedPoint) -> tuple[object, ...]:
    """Sorts points by their opening columns, then by their config."""
    opening = [_number_or_word(text) for text in point.opening.values()]
    return _by_size(opening), _by_size(point.config.values()), point.identity


def _number_or_word(text: str) -> float | str:
    """A value of a table; a number if it is spelt like one."""
    try:
        number = float(text)
    except ValueError:
        return text
    return number if math.isfinite(number) else text


def _by_size(values: Iterable[Any]) -> list[tuple[int, float, str]]:
    """Sorts values in turn: nothing, then numbers by size, then words."""
    return [
        (0, 0.0, "")
        if value is None
        else (1, float(value), "")
        if isinstance(value, int | float)
        else (2, 0.0, str(value))
        for value in values
    ]
