"""Continuous systems as tables: their tabular models, with paths that follow the true dynamics.

Methods see cells, moves between cells, and which hypotheses each path truly enters. Likelihoods may
begin and end at the states where a demonstration does, which is all that is known beside the table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy  # loads scipy.sparse when it is first used
from numpy.typing import ArrayLike

from experiments.field.entries import Case
from mlci.demonstrations import Demonstration
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.rivals.agent import Agent
from mlci.rivals.problem import Beside, Problem, Shown
from mlci.spaces import Box, Floats
from mlci.systems import System
from mlci.tabular import TabularModel, action_grid, discretize
from mlci.worlds.tables import Table, TableRegion

_POINTS = 8  # along each axis of a hypothesis, of which those inside the truth are counted


def box(lower: ArrayLike, upper: ArrayLike) -> Box:
    """A box of lists of numbers."""
    return Box(np.array(lower, dtype=float), np.array(upper, dtype=float))


@dataclass(frozen=True, eq=False)
class Cells:
    """How a continuous system becomes a table.

    Attributes:
        system: the system.
        truth: what is forbidden.
        shape: cells along each dimension.
        actions: values of each control.
        dt: time step [s].
        hypotheses: along each dimension; None where they leave it free.
        temperature: what rewards are divided by.
    """

    system: System
    truth: Regions
    shape: tuple[int, ...]
    actions: int | tuple[int, ...]
    dt: float
    hypotheses: tuple[int | None, ...]
    temperature: float = 1.0

    def case(self, demonstrations: Sequence[Demonstration], dropped: int) -> Case:
        """What methods see of some demonstrations, and what is true.

        Raises:
            ValueError: no demonstrations.
        """
        space = self.system.space
        regions = Regions.from_grid(space, self.hypotheses)
        grid, actions = Grid(space, self.shape), action_grid(self.system, self.actions)
        everything = regions.joined(self.truth)
        model = discretize(
            self.system, grid, actions, self.dt, everything, temperature=self.temperature
        )
        assert model.kept is not None
        crosses, count = model.kept.crosses.tocsc(), len(regions)
        kept = replace(model.kept, crosses=crosses[:, :count].tocsr())
        blind = replace(model, regions=regions, kept=kept, truth=np.zeros(count, dtype=bool))
        table = _table(blind)
        shown = tuple(_shown(blind, table, each) for each in demonstrations)
        tiles = Grid(space, tuple(each or 1 for each in self.hypotheses))
        bounded = [d for d, each in enumerate(self.hypotheses) if each]
        problem = Problem(
            shown,
            tuple(tiles.shape[d] for d in bounded),
            tiles.index(grid.centers)[:, None] == np.arange(count),
            (grid.centers / tiles.widths)[:, bounded],
            tuple(bool(space.periodic[d]) for d in bounded),
        )
        inside = self.truth.signed_distance(tiles.points_inside(_POINTS)) < 0
        forbidden = np.asarray(crosses[:, count:].sum(axis=1)).ravel() > 0
        return Case(problem, np.mean(inside, axis=1), forbidden, dropped)


def _table(model: TabularModel) -> Table:
    """The cells and moves of a model, from the first cell to nowhere."""
    assert model.kept is not None
    kept = model.kept
    there = kept.successor >= 0
    begins = np.append(0, np.cumsum(there.ravel()))
    shape = there.size, model.states
    chances = (np.ones(begins[-1]), kept.successor[there], begins)
    return Table(
        transitions=scipy.sparse.csr_matrix(chances, shape=shape),
        reward=np.where(there, kept.reward, 0.0),
        allowed=there,
        start=np.arange(model.states) == 0,
        goals=np.empty(0, dtype=np.int64),
        regions={name: TableRegion() for name in model.regions.names},
        crosses=kept.crosses,
        truth=np.zeros(len(model.regions), dtype=bool),
    )


def _shown(model: TabularModel, table: Table, demonstration: Demonstration) -> Shown:
    """A demonstration, and the agent who goes from its first cell to its last in the same time."""
    exact, between = (
        TrajectoryDistribution.of_task(
            model, demonstration.task, round_horizon=True, exact_ends=ends
        )
        for ends in (True, False)
    )
    start = (np.arange(model.states) == between.start).astype(float)
    agent = Agent(replace(table, start=start), between.steps, final=between.goal)
    times = np.arange(between.steps + 1) * model.dt
    nearest = np.abs(demonstration.times - times[:, None]).argmin(axis=1)
    return Shown(
        agent,
        model.grid.index(demonstration.states[nearest]),
        None,
        model.regions.violated_by(demonstration.states),
        _beside(exact),
        _beside(between),
    )


def _beside(distribution: TrajectoryDistribution) -> Beside:
    """log alpha of sets; 0, which says nothing, where the model cannot do the task."""
    if distribution.is_possible:
        return distribution.log_avoidance_beside
    return _says_nothing


def _says_nothing(mask: np.ndarray) -> Floats:
    """log alpha (C,) of 0."""
    return np.zeros(len(mask))
