"""Which discretisations to compare."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from experiments.config.settings.cells import GridSettings, Shape
from experiments.config.settings.kinds import (
    STRICT,
    Count,
    Positive,
    Seed,
    StartPoints,
    Tasks,
    about,
)
from experiments.config.settings.parts import TaskSettings
from experiments.config.settings.point import SubjectSettings
from mlci.grids import Grid

_FINENESS = (0.5, 1, 1.5, 2)  # cells along each dimension, as multiples of `grid`


@dataclass(frozen=True, config=STRICT)
class AdviceSettings(SubjectSettings):
    """What experiments/advise.py takes."""

    tasks: TaskSettings
    grid: GridSettings
    grids: Annotated[
        Annotated[tuple[Shape, ...], Field(min_length=1)] | None,
        about("shapes to compare; null takes 1/2, 1, 3/2 and 2 times the cells of `grid`"),
    ]
    dts: Annotated[
        tuple[Positive, ...],
        Field(min_length=1),
        about("time steps to compare; each divides the horizon", "s"),
    ]
    budget: Annotated[Count, about("tabular states, at most")]
    remedy: Annotated[
        StartPoints,
        about(
            "start points in a cell, along each dimension, that are tried where its centre fails"
        ),
    ]
    horizon: Annotated[Positive, about("duration of a task", "s")]
    pairs: Annotated[Tasks, about("tasks that are drawn")]
    seed: Annotated[Seed, about("of all that is random")]

    @property
    def grids_to_try(self) -> list[Grid]:
        """The grids within the budget, small ones first."""
        shapes = self.grids
        if shapes is None:
            scaled = [[round(m * count) for count in self.grid.shape] for m in _FINENESS]
            shapes = tuple(tuple(max(1, count) for count in shape) for shape in scaled)
        shift = self.grid.offset or ()
        grids = [Grid(self.model.space, shape, shift) for shape in dict.fromkeys(shapes)]
        return sorted((g for g in grids if g.size <= self.budget), key=lambda grid: grid.size)
