"""Inference from recorded demonstrations."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import (
    STRICT,
    Count,
    CountOrNone,
    DepthShare,
    Flag,
    NotNegative,
    Number,
    PathWord,
    Positive,
    Tasks,
    Word,
    about,
    one_or_list,
)
from experiments.config.settings.parts import TaskBoxSettings
from experiments.config.settings.point import ModelSettings
from experiments.config.settings.shapes import Region
from experiments.config.settings.study import RESULTS
from mlci.crossings import Crossing


@dataclass(frozen=True, config=STRICT)
class CrossingSettings:
    """What counts as entering a hypothesis."""

    depth: Annotated[
        DepthShare,
        about(
            "how deep a path must get into a hypothesis for that to count; 0 counts every touch",
            "share of its width",
        ),
    ]
    time: Annotated[
        NotNegative, about("how long it must stay inside at a time for that to count", "s")
    ]

    def crossing(self) -> Crossing:
        """The same for the inference."""
        return Crossing(self.depth, self.time)


@dataclass(frozen=True, config=STRICT)
class NextTasksSettings:
    """What to record next."""

    count: Annotated[CountOrNone, about("tasks to record next that are named; 0 names none")]
    candidates: Annotated[
        Tasks, about("tasks that are drawn, and of which the most informative are named")
    ]
    box: Annotated[
        TaskBoxSettings | None,
        about(
            "where these are drawn, as the system's `tasks`: lower, upper and goal; null takes "
            "those, or the whole state space",
            "of the state",
        ),
    ]
    file: Annotated[
        Word | None,
        about(
            "table of candidates in place of those that are drawn, with columns as of `tasks`; "
            "`trial` names them"
        ),
    ]


@dataclass(frozen=True, config=STRICT)
class RecordedSettings(ModelSettings):
    """What experiments/infer.py takes."""

    demonstrations: Annotated[
        one_or_list(PathWord, tuple[PathWord, ...]),  # type: ignore[valid-type]
        about("a folder, a glob pattern or a file, or a list of them"),
    ]
    recorded_dt: Annotated[
        Positive, about("time between the samples of files that do not tell it", "s")
    ]
    start: Annotated[
        tuple[Number, ...] | None,
        about("first state of every demonstration; null reads it off each file", "of the state"),
    ]
    goal: Annotated[
        Region | None,
        about(
            "goal of every demonstration, null for a free dimension; null alone reads it off each "
            "file",
            "of the state",
        ),
    ]
    columns: Annotated[
        dict[Word, Word] | None,
        about(
            "name of a column of the files by ours, as in {angle: theta, time: t}; `states` is an "
            "array of all states. Case, units in brackets, spaces and dashes make no difference"
        ),
    ]
    units: Annotated[
        dict[Word, Word] | None,
        about(
            "unit of a state in the files, as in {angle: deg}; else what they say, or the system's"
        ),
    ]
    time_unit: Annotated[
        Word | None,
        about(
            "unit of time in the files, such as ms; `samples` for numbers of samples that are "
            "recorded_dt apart; null for what they say, or seconds"
        ),
    ]
    max_duration: Annotated[
        Positive, about("a demonstration that lasts longer is refused: time is in ms?", "s")
    ]
    max_memory: Annotated[Positive, about("what reading one file may take", "MB")]
    tasks: Annotated[
        Word | None,
        about(
            "table of starts and goals: columns `trial`, and `start_NAME`, or `goal_lower_NAME` "
            "and `goal_upper_NAME`, of each dimension, or all"
        ),
    ]
    group_by: Annotated[
        one_or_list(Word, tuple[Word, ...]) | None,  # type: ignore[valid-type]
        about(
            "column, or list of columns, that names the trials of a file; null starts another "
            "where time starts again"
        ),
    ]
    derive: Annotated[
        dict[Word, Word] | None,
        about(
            "states that are smooth derivatives of others, as in {angular_velocity: angle}, "
            "whatever the files hold"
        ),
    ]
    derive_window: Annotated[
        Positive, about("window of the cubics that are fitted for derivatives", "s")
    ]
    bridge: Annotated[
        NotNegative,
        about("how far a path may move in a gap that a straight line bridges", "share of a cell"),
    ]
    crossing: CrossingSettings
    estimate_temperature: Annotated[
        Flag,
        about(
            "also tell the temperature that the demonstrations look like; takes about ten times as "
            "long as the inference"
        ),
    ]
    soft: Annotated[
        CountOrNone,
        about(
            "soft or hard? For so many regions, the first of the ranking before all others, the "
            "weight of each second inside, with its interval; 0 for none"
        ),
    ]
    next_tasks: NextTasksSettings
    top: Annotated[Count, about("hypotheses that are printed")]
    results: Annotated[Word | None, RESULTS]
