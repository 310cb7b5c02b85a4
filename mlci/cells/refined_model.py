"""A model whose cells are refined for each task alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

from numpy.typing import ArrayLike

from mlci.cells.refinement import check_cells, refine
from mlci.demonstrations import Task
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.systems import System
from mlci.tabular import TabularModel


@dataclass(frozen=True, eq=False)
class RefinedModel:
    """Cells of varying size of each task's own: it takes the place of a `TabularModel` in `infer`.

    A task leads through little of the space, so that cells that serve it alone are small there. It
    takes as long as forming a model of so many cells a few times for each task.

    Attributes:
        model: what is refined; its cells are the first ones.
        cells: how many each task has.

    Raises:
        ValueError, TypeError: as of `check_cells`.
    """

    model: TabularModel
    cells: int

    def __post_init__(self) -> None:
        check_cells(self.model, self.cells)

    @property
    def regions(self) -> Regions:
        """The C regions."""
        return self.model.regions

    @property
    def system(self) -> System:
        """The system, which no refinement changes."""
        return self.model.system

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return self.model.dt

    @property
    def temperature(self) -> float:
        """Temperature of the agent."""
        return self.model.temperature

    def under(self, truth: ArrayLike) -> RefinedModel:
        """The model under constraints, equation (3): cells are refined where these let tasks lead.

        Args:
            truth: as of `TabularModel.under`.
        """
        return replace(self, model=self.model.under(truth))

    def distribution(
        self, task: Task, *, round_horizon: bool = False, exact_ends: bool = True
    ) -> TrajectoryDistribution:
        """The distribution of a task, on its own cells; arguments as of `infer`."""
        refined = refine(
            self.model, [task], self.cells, round_horizon=round_horizon, exact_ends=exact_ends
        )
        return TrajectoryDistribution.of_task(
            refined, task, round_horizon=round_horizon, exact_ends=exact_ends
        )
