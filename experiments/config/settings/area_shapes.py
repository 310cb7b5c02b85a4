"""Belief over areas that have a shape: what shapes are drawn."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import (
    STRICT,
    Count,
    CountOrNone,
    HalfWidth,
    Probability,
    about,
)

MOST_SHAPES = 4000  # pairs of them take 128 MB for each array


@dataclass(frozen=True, config=STRICT)
class AreaShapeSettings:
    """What is forbidden as one or two of many shapes, beside the ranking of hypotheses."""

    count: Annotated[
        CountOrNone,
        Field(le=MOST_SHAPES),
        about(
            "shapes that are drawn, of which nothing, one or two are forbidden; 1500 are many "
            "where two dimensions are bounded; 0 asks nothing of shapes"
        ),
    ]
    kind: Annotated[Literal["ellipsoids", "boxes"], about("what they are, along the axes")]
    smallest: Annotated[
        HalfWidth, about("least half width of a shape", "share of a dimension's range")
    ]
    largest: Annotated[HalfWidth, about("largest half width", "share of a dimension's range")]
    pair: Annotated[
        Probability, about("prior probability that two shapes are forbidden, if any are")
    ]
    apart: Annotated[bool, about("whether two shapes that are forbidden share no point")]
    samples: Annotated[
        Count, about("trajectories drawn for each task, to tell how many avoid two shapes")
    ]
