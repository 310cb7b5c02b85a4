"""What a person reads of studies and points: lists, states, and all about one or two of them."""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

from experiments.lookback.archive import Archive, Facts, count_states
from experiments.lookback.freshness import figure_concerns, is_shipped, table_concerns
from experiments.lookback.query import varying
from experiments.terminal import counted, job_names, table_lines
from experiments.tracking import report_note
from experiments.tracking.figure_notes import note_damage
from experiments.tracking.files import read_file
from experiments.tracking.points import State
from experiments.tracking.study import Study
from experiments.tracking.trees import flatten

_SHORT = 12  # characters of an identity that are shown; any that are enough can be typed
_RUN = "python experiments/run.py"
_OF_SWEEP = ("experiment=", "scale=", "study=", "subject=")  # overrides that a study's sweep needs
_HANGING = " " * 10  # opens a line that goes on
_COLUMNS = ("truth", "cells", "actions", "dt", "samples", "seed")


def study_list(archive: Archive, width: int | None) -> Iterator[str]:
    """A line for each study, and one for the points in none."""
    yield from archive.unreadable
    rows: list[list[object]] = [["study", "points", *State, "tables"]]
    for study in archive.studies.values():
        counts = count_states(archive.points_of(study))
        tables = len(study.collated.tables) if study.collated else 0
        rows.append([study.name, len(study.points), *(counts[s] for s in State), tables])
    planned = {point for study in archive.studies.values() for point in study.points}
    alone = [point for name, point in archive.points.items() if name not in planned]
    if alone:
        counts = count_states(alone)
        rows.append(["(no study)", len(alone), *(counts[s] for s in State), None])
    yield from table_lines(rows, width) if len(rows) > 1 else [f"no study in {archive.results}"]


def point_list(
    archive: Archive, study: Study | None, states: Sequence[State], width: int | None
) -> Iterator[str]:
    """A line for each point of a study, or of all; `states` keeps some of them."""
    yield from archive.unreadable
    if study is None:
        members: dict[str, list[str]] = {name: [] for name in archive.points}
        for listed in archive.studies.values():
            for name in listed.points:
                members.setdefault(name, []).append(listed.name)
        points = [archive.point(name) for name in members]
        names = [", ".join(studies) or "(no study)" for studies in members.values()]
    else:
        points = archive.points_of(study)
        names = job_names(list(study.points.values())) if study.points else []
    columns = _COLUMNS if study is None else ()
    which = "study" if study is None else "which"
    rows: list[list[object]] = [["point", "state", *columns, which, "seconds", "started"]]
    for point, name in zip(points, names, strict=True):
        if not states or point.state in states:
            seconds = point.record.get("seconds", {}).get("total")
            started = str(point.record.get("started", ""))[:19]
            values = [point.summary.get(column) for column in columns]
            rows.append([_short(point), point.state, *values, name, seconds, started])
    yield from _without_empty(rows, width)


def summary_list(points: Sequence[Facts], width: int | None) -> Iterator[str]:
    """A line for each finished point: what its config has of its own, and its summary."""
    # The summary opens with columns that say the same as these keys.
    repeated = ("truth.", "dt", "actions", "grid.shape", "transition.samples", "seed")
    extra = [key for key in varying(points) if not key.startswith(repeated)]
    facts: list[dict[str, object]] = [
        {
            "state": str(point.state),
            **{key: point.config.get(key) for key in extra},
            **{key: _rounded(value) for key, value in point.summary.items()},
        }
        for point in points
    ]
    keys = dict.fromkeys(key for row in facts for key in row)
    common = [key for key in keys if len({str(row.get(key)) for row in facts}) == 1]
    if len(points) > 1:
        keys = dict.fromkeys(key for key in keys if key not in common)
        yield from _fact_lines({"in all": "", **{key: facts[0].get(key) for key in common}})
        yield ""
    rows: list[list[object]] = [["point", *keys]]
    for point, row in zip(points, facts, strict=True):
        rows.append([_short(point), *(row.get(key) for key in keys)])
    yield from _folded(rows, width)


def study_status(archive: Archive, study: Study, width: int | None) -> Iterator[str]:
    """A study's points by state, then what is up to date, or shipped as it was made.

    Lines are broken at a width, if one is given.
    """
    for line in _status_lines(archive, study):
        yield from textwrap.wrap(line, width, subsequent_indent=_HANGING) if width else [line]


def _status_lines(archive: Archive, study: Study) -> Iterator[str]:
    """The same, unbroken; figures of which the same is to be said share a line."""
    points = archive.points_of(study)
    counts = count_states(points)
    states = ", ".join(f"{counts[state]} {state}" for state in State if counts[state])
    yield f"{study.name}: {counted(len(points), 'point')}: {states or 'none'}"
    for point in points:
        if point.damage:
            yield f"  point   {_short(point)} does not count: {point.damage}"
    fresh = "shipped, unchanged" if is_shipped(points) else "up to date"
    yield f"  tables  {_freshness(table_concerns(study, points), fresh)}"
    figures, damage = figure_concerns(study, points), note_damage(study.folder)
    if not figures:
        yield f"  figures {damage or 'not drawn'}"
    alike: dict[str, list[str]] = {}
    for name, concerns in figures.items():
        alike.setdefault(_freshness(concerns, fresh), []).append(name)
    for told, names in alike.items():
        yield f"  {'figures' if len(names) > 1 else 'figure '} {', '.join(names)}: {told}"
    report = report_note.concerns(study.folder)
    if report is not None:
        yield f"  report  {_freshness(report, fresh)}"


def point_facts(archive: Archive, facts: Facts) -> Iterator[str]:
    """State, config and record by dotted keys, then the log."""
    point, record = facts.point, facts.record
    yield f"point    {point.identity}"
    yield f"state    {facts.state}"
    yield f"folder   {point.results / 'points' / point.identity}"
    if facts.state is State.STALE:
        yield f"         source was {record['source'][:_SHORT]}, is {point.source[:_SHORT]}"
    if facts.state is State.SHIPPED:
        yield from _shipped_lines(facts, archive)
    if facts.damage:
        yield f"         its record does not count: {facts.damage}"
    if failure := facts.failure:
        reasons = flatten({key: value for key, value in failure.items() if key != "traceback"})
        yield from ["", "failure", *_fact_lines(reasons)]
        yield from f"{failure.get('traceback')}".splitlines()
    if record:
        rest = {key: value for key, value in record.items() if key not in ("config", "summary")}
        yield from ["", "config", *_fact_lines(facts.config)]
        yield from ["", "record", *_fact_lines(flatten(rest))]
        yield from ["", "summary", *_fact_lines(facts.summary)]
    with suppress(OSError):
        log = read_file(point.folder / "log.txt").decode(errors="replace")
        yield from ["", "log", *(f"  {line}" for line in log.splitlines())]


def _shipped_lines(facts: Facts, archive: Archive) -> Iterator[str]:
    """What runs a point that is not stored here, and where its values are meanwhile."""
    for study in archive.studies.values():
        if facts.point.identity in study.points:
            overrides = study.points[facts.point.identity]
            if facts.state is State.SHIPPED:
                yield f"         not stored here; tables of the study {study.name} have its values"
            sweep = [each for each in overrides if each.startswith(_OF_SWEEP)]
            is_sweep = any(each.startswith("experiment=") for each in sweep)
            words = ["-m", *sweep] if is_sweep else overrides
            yield f"         to run it: {_RUN} {shlex.join(words)}"


def study_facts(archive: Archive, study: Study, width: int | None) -> Iterator[str]:
    """Status, what varies, and what the tables came from."""
    yield from study_status(archive, study, width)
    values: dict[str, dict[str, None]] = {}
    for overrides in study.points.values():
        for key, _, value in (override.partition("=") for override in overrides):
            values.setdefault(key, {})[value] = None
    yield from ["", "sweep", *_fact_lines({key: ", ".join(texts) for key, texts in values.items()})]
    if study.collated:
        collated = study.collated
        facts: dict[str, object] = {
            "sources": ", ".join(f"{s[:_SHORT]} ({n})" for s, n in collated.sources.items()),
            "commits": ", ".join(c[:_SHORT] for c in collated.commits) or None,
            "dirty": collated.dirty,
            "started": " to ".join(collated.started),
        }
        yield from ["", "tables from", *_fact_lines(facts), "", "tables"]
        yield from _fact_lines({name: digest[:_SHORT] for name, digest in collated.tables.items()})


def differences(archive: Archive, one: Facts, two: Facts, width: int | None) -> Iterator[str]:
    """Differing facts of two points, side by side; of one that is not here, how to run it."""
    for facts in (one, two):
        if not facts.record:
            yield f"{facts.point.identity}: {facts.state}, so there is nothing to compare"
            yield from _shipped_lines(facts, archive)
    if not (one.record and two.record):
        return
    parts: list[tuple[str, Mapping[str, Any], Mapping[str, Any]]] = [
        ("config", one.config, two.config),
        ("versions and run", _comparable(one.record), _comparable(two.record)),
        ("tables", one.record.get("files", {}), two.record.get("files", {})),
        ("summary", one.summary, two.summary),
    ]
    rows = [
        ["", _short(one), _short(two)],
        ["state", str(one.state), str(two.state)],
    ]
    for title, first, second in parts:
        keys = [k for k in dict.fromkeys((*first, *second)) if first.get(k) != second.get(k)]
        rows.append([f"{title}: {len(keys) or 'nothing'} differ{'s' * (len(keys) < 2)}", "", ""])
        rows += [[f"  {key}", _text(first.get(key)), _text(second.get(key))] for key in keys]
    if width is not None:
        room = max(_SHORT, (width - 4 - max(len(row[0]) for row in rows)) // 2)
        rows = [[key, *(_cut(text, room) for text in texts)] for key, *texts in rows]
    yield from table_lines(rows)


def _comparable(record: dict[str, Any]) -> dict[str, Any]:
    """What of a record tells how and where a point ran."""
    result = ("identity", "config", "seed", "summary", "files", "stages")
    return flatten({key: value for key, value in record.items() if key not in result})


def _freshness(concerns: Sequence[str], fresh: str) -> str:
    """Whether something is up to date, or why not."""
    return f"not up to date: {'; '.join(concerns)}" if concerns else fresh


def _fact_lines(facts: Mapping[str, Any]) -> Iterator[str]:
    """A line for each fact."""
    yield from table_lines([[f"  {key}", _text(value)] for key, value in facts.items()] or [[""]])


def _without_empty(rows: Sequence[Sequence[object]], width: int | None) -> Iterator[str]:
    """A table's lines, without the columns that no row fills."""
    if len(rows) == 1:
        return iter(["no such point"])
    filled = [
        any(cell not in (None, "") for cell in column[1:]) for column in zip(*rows, strict=True)
    ]
    full = [[cell for cell, keep in zip(row, filled, strict=True) if keep] for row in rows]
    return table_lines(full, width)


def _folded(rows: Sequence[Sequence[object]], width: int | None) -> Iterator[str]:
    """A table's lines, in as many blocks as need be; each opens with the first column."""
    first, end = 1, len(rows[0])
    while first < len(rows[0]):
        block = [[row[0], *row[first:end]] for row in rows]
        lines = list(table_lines(block))
        if width is not None and end - first > 1 and max(map(len, lines)) > width:
            end -= 1
            continue
        yield from [*([""] if first > 1 else []), *lines]
        first, end = end, len(rows[0])


def _short(facts: Facts) -> str:
    """The beginning of a point's identity."""
    return facts.point.identity[:_SHORT]


def _rounded(value: object) -> object:
    """A number as a person reads it."""
    return float(f"{value:.4g}") if isinstance(value, float) else value


def _text(value: object) -> str:
    """A fact as text; a long hash by its beginning."""
    if isinstance(value, str) and len(value) in (32, 40, 64) and value.isalnum():
        return value[:_SHORT]
    return "-" if value is None else str(value)


def _cut(text: str, room: int) -> str:
    """A text no longer than some room."""
    return text if len(text) <= room else f"{text[: room - 3]}..."
