"""Whether points, tables, figures and report are those of the code of now, and if not, why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from experiments.collate.current import made_of
from experiments.lookback.archive import Facts, count_states
from experiments.tracking import figure_notes
from experiments.tracking.own_modules import on_path
from experiments.tracking.points import State, point_source
from experiments.tracking.study import Study, table_source
from experiments.tracking.study_tables import table_changes


def point_concerns(points: Sequence[Facts]) -> list[str]:
    """How many of a study's points are not done."""
    counts = count_states(points)
    return [
        f"{counts[state]} point{'s are' if counts[state] > 1 else ' is'} {state}"
        for state in (State.STALE, State.FAILED, State.RUNNING, State.MISSING)
        if counts[state]
    ]


def is_shipped(points: Sequence[Facts]) -> bool:
    """Whether some of a study's points are not stored here, but in its tables."""
    return any(point.state is State.SHIPPED for point in points)


def shipped_concerns(study: Study, points: Sequence[Facts]) -> list[str]:
    """Whether the code, or a package, of points that are not stored here is another one now."""
    collated = study.collated
    if collated is None or not is_shipped(points):
        return []
    if set(collated.sources) <= {_source_now(module) for module in collated.systems}:
        return []
    return ["the code that computes points, or a package that it uses, has changed since"]


def _source_now(module: str) -> str:
    """Hash of the source, as it is now, of points with a module's system."""
    with on_path(module):
        return point_source(module)


def table_concerns(study: Study, points: Sequence[Facts]) -> list[str]:
    """Why the tables of a study are not up to date; empty if they are."""
    collated = study.collated
    if collated is None:
        return ["not written yet", *point_concerns(points)]
    changes = table_changes(study)
    concerns = list(changes.damaged)
    if not is_shipped(points):  # the largest tables are not
        concerns += [f"table {name} is missing" for name in changes.missing]
    if set(collated.points) != set(study.points):
        concerns.append("they hold other points than the study's last sweep")
    elif all(point.record for point in points) and points:
        sources = Counter(point.record["source"] for point in points)
        records = {point.point.identity: point.record for point in points}
        attempts = [int(records[name].get("attempt", 1)) for name in collated.points]
        # Clocks go back; numbers of attempts do not.
        if sources != collated.sources or attempts != list(collated.attempts or attempts):
            concerns.append("points have run again since")
        elif collated.made_of != made_of(records, study):
            concerns.append("the study's last sweep was stopped before it wrote them")
    if len(collated.sources) > len(collated.systems):  # a system brings source of its own
        concerns.append(f"they mix {len(collated.sources)} versions of the source")
    if collated.points and collated.made_by != table_source():
        concerns.append("the code that makes them of points, or a package, has changed since")
    return concerns + shipped_concerns(study, points) + point_concerns(points)


def figure_concerns(study: Study, points: Sequence[Facts]) -> dict[str, list[str]]:
    """Why each figure of a study is not up to date, by its name; empty for one that is."""
    of_points = shipped_concerns(study, points) + point_concerns(points)
    figures = figure_notes.concerns(study.folder)
    return {name: concerns + of_points for name, concerns in figures.items()}
