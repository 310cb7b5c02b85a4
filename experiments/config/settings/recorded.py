"""Inference from recorded demonstrations."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import (
    STRICT,
    Count,
    Flag,
    Number,
    Positive,
    Word,
    about,
    one_or_list,
)
from experiments.config.settings.parts import Region
from experiments.config.settings.point import ModelSettings
from experiments.config.settings.study import RESULTS


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
    estimate_temperature: Annotated[
        Flag,
        about(
            "also tell the temperature that the demonstrations look like; takes about ten times as "
            "long as the inference"
        ),
    ]
    top: Annotated[Count, about("hypotheses that are printed")]
    results: Annotated[Word | None, RESULTS]
