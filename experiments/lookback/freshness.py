"""Whether the tables and figures of a study are those of its points, and if not, why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from experiments.lookback.archive import Facts, count_states
from experiments.tracking import figure_notes
from experiments.tracking.files import digest
from experiments.tracking.points import State
from experiments.tracking.study import Study


def point_concerns(points: Sequence[Facts]) -> list[str]:
    """How many of a study's points are not done."""
    counts = count_states(points)
    return [
        f"{counts[state]} point{'s are' if counts[state] > 1 else ' is'} {state}"
        for state in (State.STALE, State.FAILED, State.RUNNING, State.MISSING)
        if counts[state]
    ]


def table_concerns(study: Study, points: Sequence[Facts]) -> list[str]:
    """Why the tables of a study are not up to date; empty if they are."""
    collated = study.collated
    if collated is None:
        return ["not written yet", *point_concerns(points)]
    concerns = []
    for name, written in collated.tables.items():
        path = study.folder / "tables" / name
        if not path.exists():
            concerns.append(f"table {name} is missing")
        elif digest(path.read_bytes()) != written:
            concerns.append(f"table {name} was changed after it was written")
    if set(collated.points) != set(study.points):
        concerns.append("they hold other points than the study's last sweep")
    elif all(point.record for point in points):
        sources = Counter(point.record["source"] for point in points)
        latest = max(point.record["started"] for point in points)
        if sources != collated.sources or latest > collated.started[1]:
            concerns.append("points have run again since")
    if len(collated.sources) > 1:
        concerns.append(f"they mix {len(collated.sources)} versions of the source")
    return concerns + point_concerns(points)


def figure_concerns(study: Study, points: Sequence[Facts]) -> dict[str, list[str]]:
    """Why each figure of a study is not up to date, by its name; empty for one that is."""
    of_points = point_concerns(points)
    figures = figure_notes.concerns(study.folder)
    return {name: concerns + of_points for name, concerns in figures.items()}
