"""Where and how points run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import (
    STRICT,
    Count,
    CountOrNone,
    Duration,
    Flag,
    Word,
    about,
)
from experiments.config.settings.point import Settings

RESULTS = about(
    "folder of results; null is `results` of the checkout or, outside of it, of the current folder"
)


@dataclass(frozen=True, config=STRICT)
class SweepSettings:
    """Which points of a sweep run, and what is done about those that fail."""

    only: Annotated[
        tuple[Literal["missing", "failed", "stale"], ...] | None,
        about("run points in these states alone; null runs all that are not done"),
    ]
    force: Annotated[Flag, about("run points even if they are done")]
    limit: Annotated[Count | None, about("run at most so many points; null is no limit")]
    time_limit: Annotated[
        Duration | None, about("time that a point may take; null is no limit", "s")
    ]
    retries: Annotated[CountOrNone, about("how often a point that failed is tried again")]
    fail_fast: Annotated[Flag, about("start no point after one has failed")]
    dry_run: Annotated[Flag, about("list the points with their states, and run none")]
    mix_sources: Annotated[
        Flag, about("let tables join points of different versions of the source")
    ]
    replace: Annotated[
        Flag, about("let a study of this name lose points that are not in the sweep")
    ]


@dataclass(frozen=True, config=STRICT)
class StudySettings:
    """What changes no result, so that it is no part of a point's identity."""

    study: Annotated[
        Word | None,
        about("a sweep's tables go to `RESULTS/STUDY/tables`; null makes a name of its points"),
    ]
    case: Annotated[
        Word | None,
        about("what a point is an instance of, in words, for the study's table of cases"),
    ]
    results: Annotated[Word | None, RESULTS]
    workers: Annotated[Count | None, about("processes of a sweep; null is one a core")]
    examples: Annotated[
        Mapping[str, Any],
        about("points that a study shows in full, by the name of the table that shows them"),
    ]
    sweep: SweepSettings


@dataclass(frozen=True, config=STRICT)
class RunSettings(StudySettings, Settings):
    """What experiments/run.py takes: a point, and how it runs."""
