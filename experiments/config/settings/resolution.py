"""What is asked of the cells: how the error of Phi falls with their number."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import STRICT, Count, CountOrNone, about

CellKind = Literal["centre", "averaged", "multilinear", "round goals", "varying", "of each task"]


@dataclass(frozen=True, config=STRICT)
class ResolutionSettings:
    """Equal cells, cells of varying size and multilinear moves, compared on Phi of some tasks."""

    counts: Annotated[
        tuple[Count, ...],
        about(
            "numbers of cells at which kinds of cells are compared; none compares nothing. Equal "
            "cells keep the proportions of `grid.shape`, and varying ones begin with it"
        ),
    ]
    varying: Annotated[
        tuple[Count, ...] | None,
        about("numbers of cells of varying size; null is those of `counts`"),
    ]
    most: Annotated[Count, about("larger numbers of cells are lowered to this")]
    kinds: Annotated[
        Annotated[tuple[CellKind, ...], Field(min_length=1)],
        about("kinds of cells that are compared"),
    ]
    tasks: Annotated[Count, about("the first so many demonstrations' tasks are compared on")]
    paths: Annotated[Count, about("sampled paths of a task, the reference without cells")]
    finest: Annotated[
        CountOrNone,
        about(
            "equal cells that stand for the limit of the same actions, the other reference; 0 does "
            "without"
        ),
    ]

    def counts_of(self, kind: str) -> tuple[int, ...]:
        """Numbers of cells of a kind."""
        varies = kind in ("varying", "of each task")
        counts = self.counts if self.varying is None or not varies else self.varying
        return tuple(dict.fromkeys(min(count, self.most) for count in counts))
