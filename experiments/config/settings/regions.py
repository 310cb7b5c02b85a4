"""What may be forbidden: the hypotheses, and the truth."""

from __future__ import annotations

import math
from functools import reduce
from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from experiments.config.settings.controls import ControlHypothesesSettings, ForbiddenControls
from experiments.config.settings.kinds import (
    DRAWN,
    STRICT,
    Count,
    IndexOrDrawn,
    Word,
    about,
)
from experiments.config.settings.shapes import ShapeList
from mlci.regions import Regions
from mlci.spaces import StateSpace

NO_TRUTH = "none"  # the truth's name where nothing is forbidden

CellCounts = Annotated[tuple[Count | None, ...], Field(min_length=1)]


@dataclass(frozen=True, config=STRICT)
class TruthSettings(ShapeList):
    """The true constraint: the union of what is listed, a hypothesis, or nothing at all."""

    name: Annotated[Word, about(f"what tables call it; `{NO_TRUTH}` where nothing is forbidden")]
    cell: Annotated[
        IndexOrDrawn | None,
        about(
            "or one of the hypotheses, by its number; `drawn` takes, for each seed, one at random "
            "of those that a sixth of its tasks cross where nothing is forbidden, or the most"
        ),
    ]
    controls: ForbiddenControls

    @property
    def is_drawn(self) -> bool:
        """Whether the truth is known only when the point runs."""
        return self.cell == DRAWN

    @property
    def number(self) -> int | None:
        """The hypothesis that is the truth; None if it is none of them.

        Raises:
            ValueError: it is drawn when the point runs.
        """
        if isinstance(self.cell, str):
            raise ValueError("the truth is drawn when the point runs")
        return self.cell

    @property
    def label(self) -> str:
        """The name, with the number of the hypothesis."""
        return self.name if self.cell is None or self.is_drawn else f"{self.name}_{self.cell}"


@dataclass(frozen=True, config=STRICT)
class HypothesesSettings(ShapeList):
    """Cells of a regular grid (None leaves a dimension free), then listed regions."""

    shape: Annotated[
        CellCounts | None,
        about(
            "hypotheses as cells along each dimension, null for a dimension left free; null alone "
            "is none"
        ),
    ]
    grids: Annotated[
        tuple[CellCounts, ...],
        about("further hypotheses: cells of more grids, each given as `hypotheses.shape` is"),
    ]
    controls: ControlHypothesesSettings

    @property
    def shapes_of_grids(self) -> tuple[CellCounts, ...]:
        """Of all grids."""
        return self.grids if self.shape is None else (self.shape, *self.grids)

    @property
    def number(self) -> int:
        """How many hypotheses about states there are."""
        cells = [math.prod(count or 1 for count in shape) for shape in self.shapes_of_grids]
        return sum(cells) + self.count

    def regions(self, space: StateSpace) -> Regions:
        """All hypotheses, in the order in which tables number them."""
        regions = [Regions.from_grid(space, shape) for shape in self.shapes_of_grids]
        return reduce(Regions.joined, [*regions, Regions.from_shapes(space, self.listed())])
