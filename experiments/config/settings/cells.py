"""The cells of a model, and how moves start in them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import STRICT, Count, CountOrNone, Share, about

Shape = Annotated[tuple[Count, ...], Field(min_length=1)]


@dataclass(frozen=True, config=STRICT)
class GridSettings:
    """The cells of the tabular model."""

    shape: Annotated[Shape, about("cells of the tabular model along each dimension")]
    offset: Annotated[
        tuple[Share, ...] | None,
        about(
            "shift of the cells along each dimension, periodic ones only; null is none",
            "share of a cell",
        ),
    ]
    refined: Annotated[
        CountOrNone,
        about(
            "cells of varying size that each task has for its own: those of `shape`, halved where "
            "the task is likely to lead; 0 leaves all tasks the equal ones"
        ),
    ]


@dataclass(frozen=True, config=STRICT)
class TransitionSettings:
    """How transitions of the tabular model start."""

    samples: Annotated[
        Count, about("start points in a cell along each dimension; 1 is the cell's centre alone")
    ]
