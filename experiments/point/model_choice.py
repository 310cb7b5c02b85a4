"""Cells or sampled paths? Both on one task, where both can do it, and which of them suits."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.config.settings import AdviceSettings
from experiments.terminal import entry
from mlci.cells.refined_model import RefinedModel
from mlci.demonstrations import Demonstration
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.sampled.diagnosis import SamplingDiagnosis
from mlci.sampled.model import SampledModel
from mlci.spaces import Box, Floats
from mlci.tabular import TabularModel, discretize

_TOO_FAR = 3.0  # times what samples explain: cells are off


@dataclass(frozen=True)
class ModelChoice:
    """What both models say of one task.

    Attributes:
        task_s: processor time of sampled paths [s].
        samples: whether to believe them; None where no path reaches the goal.
        error: root mean square standard error of Phi by its samples, over the regions.
        apart: root mean square difference of Phi between cells and paths; None where cells cannot
            do the task, or none are recommended.
        largest: the largest of these differences.
        refined: how many cells of the task's own were tried; 0 for none.
        refined_apart: `apart` of these; None where they cannot do the task.
    """

    task_s: float
    samples: SamplingDiagnosis | None
    error: float = np.nan
    apart: float | None = None
    largest: float = np.nan
    refined: int = 0
    refined_apart: float | None = None

    def lines(self) -> list[str]:
        """What was found, and which model to take when, a phrase a line."""
        found = self._lines()
        if self.refined and self.samples is not None:
            found.append(f"grid.refined={self.refined}: {self._of_refined}")
        return found

    @property
    def _of_refined(self) -> str:
        """How near cells of the task's own come to sampled paths."""
        if self.refined_apart is None:
            return "these cells cannot do the task"
        return (
            f"cells of the task's own differ from these paths by {self.refined_apart:.2g} (root "
            "mean square over regions)"
        )

    def _lines(self) -> list[str]:
        """The same without refined cells."""
        if self.samples is None:
            return [f"model=tabular: no sampled path does the task ({self.task_s:.2g} s)"]
        paths = (
            f"one task takes sampled paths {self.task_s:.2g} s, with "
            f"{self.samples.effective:.0f} effective samples and errors of Phi of {self.error:.2g}"
        )
        if not self.samples.trusted:
            why = "; ".join(self.samples.complaints)
            return [paths, f"model=tabular: these samples are not to be believed: {why}"]
        if self.apart is None:
            return [paths, "model=sampled: no grid within the budget suits, and paths need none"]
        both = (
            f"cells differ from them by {self.apart:.2g} (root mean square over regions; at most "
            f"{self.largest:.2g})"
        )
        if self.apart > _TOO_FAR * self.error:
            return [
                paths,
                f"{both}: {self.apart / self.error:.0f} times what samples explain, so that these "
                "cells are too coarse, or actions too few, for probabilities to be exact",
                "model=sampled where probabilities count; model=tabular where a quick ranking does",
            ]
        return [
            paths,
            f"{both}, no more than samples explain",
            "model=tabular: it has no error of samples, and tells temperature and soft weights too",
        ]


def compare_models(
    settings: AdviceSettings, paths: Sequence[Demonstration], cells: TabularModel | None, dt: float
) -> ModelChoice:
    """Let sampled paths, and cells if there are any, do the first task that both can.

    Args:
        settings: the system, its actions and hypotheses.
        paths: at least one, whose tasks these are.
        cells: the recommended tabular model; None where none is.
        dt: the time step [s].
    """
    task, by_cells = paths[0].task, None
    for path in paths:
        found = None if cells is None else TrajectoryDistribution.of_task(cells, path.task)
        if found is not None and found.is_possible:
            task, by_cells = path.task, found
            break
    actions = settings.action_values
    limit = Box(np.min(actions, axis=0), np.max(actions, axis=0))
    model = SampledModel(settings.model, settings.candidates, dt, limit=limit)
    before = time.process_time()
    sampled = model.distribution(task)
    if not sampled.is_possible:
        return ModelChoice(time.process_time() - before, None)
    phi, errors = sampled.violation_probabilities(), sampled.avoidance_errors()
    spent, error = time.process_time() - before, float(np.sqrt(np.mean(np.square(errors))))
    refined_apart = None
    if settings.grid.refined:
        by_refined = refined_cells(settings, cells, dt).distribution(task)
        if by_refined.is_possible:
            refined_apart, _ = _apart(by_refined.violation_probabilities(), phi)
    refined = settings.grid.refined, refined_apart
    if by_cells is None:
        return ModelChoice(spent, sampled.diagnosis, error, None, np.nan, *refined)
    apart = _apart(by_cells.violation_probabilities(), phi)
    return ModelChoice(spent, sampled.diagnosis, error, *apart, *refined)


def _apart(one: Floats, other: Floats) -> tuple[float, float]:
    """Root mean square and largest difference."""
    difference = np.abs(one - other)
    return float(np.sqrt(np.mean(np.square(difference)))), float(np.max(difference))


def choose_model(
    settings: AdviceSettings,
    paths: Sequence[Demonstration],
    cells: TabularModel | None,
    dt: float,
    log: Callable[[str], None],
) -> None:
    """Print which model to take and why; arguments as of `compare_models`."""
    choice = compare_models(settings, paths, cells, dt)
    for number, phrase in enumerate(choice.lines()):
        for line in entry("" if number else "cells or paths", phrase):
            log(line)


def refined_cells(settings: AdviceSettings, cells: TabularModel | None, dt: float) -> RefinedModel:
    """Cells of each task's own, as the settings say; moves start as in some cells."""
    model = TabularModel(
        settings.model,
        Grid(settings.model.space, settings.grid.shape),
        settings.action_values,
        dt,
        settings.candidates,
        samples=settings.remedy if cells is None else cells.samples,
    )
    return RefinedModel(model, settings.grid.refined)


def formed_cells(settings: AdviceSettings, grid: Grid, dt: float, samples: int) -> TabularModel:
    """The tabular model of a discretisation."""
    return discretize(
        settings.model, grid, settings.action_values, dt, settings.candidates, samples
    )
