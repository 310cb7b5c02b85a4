"""The points of a sweep: the overrides that make each, and what was known of it at the start."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from experiments.config.paths import results_folder
from experiments.config.read import read_config
from experiments.config.settings import Settings, StudySettings, SweepSettings
from experiments.tracking.points import Point, State
from experiments.tracking.trees import plain

Job = tuple[str, ...]  # the overrides that make a point


@dataclass(frozen=True, eq=False)
class PlannedPoint:
    """A point of a sweep.

    Attributes:
        job: the overrides that make it.
        name: what tells it from the sweep's other points.
        point: the point.
        state: what was known of it when the sweep was planned.
    """

    job: Job
    name: str
    point: Point
    state: State


def read_point(tree: dict[str, Any]) -> tuple[Point, Settings, StudySettings]:
    """The point of a resolved config, and its settings.

    Raises:
        ConfigError: the config cannot be run.
    """
    settings, study = read_config(tree)
    return Point.planned(plain(settings), results_folder(study)), settings, study


def select_points(plan: Iterable[PlannedPoint], options: SweepSettings) -> list[PlannedPoint]:
    """The points of a plan that are to run."""
    if options.only is not None:
        selection = [planned for planned in plan if planned.state in options.only]
    else:
        selection = [
            planned for planned in plan if options.force or planned.state is not State.DONE
        ]
    return selection[: options.limit]


def count_states(plan: Iterable[PlannedPoint]) -> str:
    """How many points are in each state, as words."""
    counts = Counter(planned.state for planned in plan)
    return ", ".join(f"{counts[state]} {state}" for state in State if counts[state])
