"""Inference from recorded demonstrations."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import (
    STRICT,
    Count,
    DepthShare,
    Flag,
    NotNegative,
    Number,
    Positive,
    Word,
    about,
    one_or_list,
)
from experiments.config.settings.parts import Region
from experiments.config.settings.point import ModelSettings
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
class RecordedSettings(ModelSettings):
    """What experiments/infer.py takes."""

    demonstrations: Annotated[
        one_or_list(Word, tuple[Word, ...]),  # type: ignore[valid-type]
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
    round_horizon: Annotated[
        Flag,
        about("take the nearest whole number of time steps where dt does not divide a duration"),
    ]
    crossing: CrossingSettings
    estimate_temperature: Annotated[
        Flag,
        about(
            "also tell the temperature that the demonstrations look like; takes about ten times as "
            "long as the inference"
        ),
    ]
    top: Annotated[Count, about("hypotheses that are printed")]
    results: Annotated[Word | None, RESULTS]
