"""What decides a point's result, as frozen dataclasses; conf/config.yaml explains every value."""

from __future__ import annotations

import importlib
import inspect
import math
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mlci.grids import Grid
from mlci.regions import ConstraintSet
from mlci.spaces import Box, StateSpace
from mlci.systems import System

NO_TRUTH = "none"  # the truth's name where nothing is forbidden


@dataclass(frozen=True)
class Region:
    """A box of states; None leaves that dimension free, at both ends."""

    lower: tuple[float | None, ...]
    upper: tuple[float | None, ...]

    def box(self) -> Box:
        """The region with infinite sides where a dimension is free."""
        return Box(
            np.array([-np.inf if side is None else side for side in self.lower]),
            np.array([np.inf if side is None else side for side in self.upper]),
        )


@dataclass(frozen=True)
class TaskSettings(Region):
    """Where starts and goals are drawn, and which of the tasks count.

    Attributes:
        goal: how far the goal reaches around the state that was drawn for it, in each dimension;
            None leaves that dimension free, and for `goal` itself makes it a point.
        crossing: only tasks whose optimum, were there no constraint, enters the truth.
    """

    goal: tuple[float | None, ...] | None
    crossing: bool

    def start_box(self, space: StateSpace) -> Box:
        """Where starts and goals are drawn; a free dimension spans the state space."""
        box, bounds = self.box(), space.bounds
        return Box(
            np.where(np.isfinite(box.lower), box.lower, bounds.lower),
            np.where(np.isfinite(box.upper), box.upper, bounds.upper),
        )

    @property
    def goal_offsets(self) -> Box | None:
        """The goal region relative to its middle; None for a point."""
        if self.goal is None:
            return None
        reach = np.array([np.inf if side is None else side for side in self.goal])
        return Box(-reach, reach)


@dataclass(frozen=True)
class SystemSettings:
    """A subclass of mlci.systems.System by its dotted name, and its constructor's arguments."""

    target: str
    arguments: Mapping[str, Any]

    def build(self) -> System:
        """The system itself."""
        return system_class(self.target)(**self.arguments)


@dataclass(frozen=True)
class TruthSettings:
    """The true constraint: the union of its boxes, one of the hypotheses, or nothing at all.

    Attributes:
        name: what tables call it; NO_TRUTH for nothing.
        boxes: its boxes; none where a hypothesis is the truth, or nothing is.
        cell: the hypothesis that is the truth, by its number; None for boxes.
    """

    name: str
    boxes: tuple[Region, ...]
    cell: int | None

    @property
    def label(self) -> str:
        """The name, with the number of the hypothesis."""
        return self.name if self.cell is None else f"{self.name}_{self.cell}"


@dataclass(frozen=True)
class GridSettings:
    """The cells of the tabular model, and how far they are shifted, as shares of a cell."""

    shape: tuple[int, ...]
    offset: tuple[float, ...] | None


@dataclass(frozen=True)
class TransitionSettings:
    """From how many points of a cell, along each dimension, its transitions start."""

    samples: int


@dataclass(frozen=True)
class HypothesesSettings:
    """Cells of a regular grid (None leaves a dimension free), then listed boxes."""

    shape: tuple[int | None, ...] | None
    boxes: tuple[Region, ...]

    def regions(self, space: StateSpace) -> ConstraintSet:
        """All hypotheses, in the order in which tables number them."""
        boxes = [region.box() for region in self.boxes]
        if self.shape is None:
            return ConstraintSet.from_boxes(space, boxes)
        cells = ConstraintSet.from_grid(space, self.shape)
        return cells.joined(ConstraintSet.from_boxes(space, boxes)) if boxes else cells


@dataclass(frozen=True)
class DemonstrationSettings:
    """How demonstrations are generated."""

    pairs: int
    keep: int
    dt: float
    goal_tolerance: float
    restarts: int
    iterations: int
    goal_weight: float
    hold: float
    clip: bool
    wind: bool


@dataclass(frozen=True)
class SafetySettings:
    """How the safe set is found, on which grid; the filter's margin (None: derived) and width."""

    method: str
    shape: tuple[int, ...]
    margin: float | None
    width: float


@dataclass(frozen=True)
class InferenceSettings:
    """`prior`: probability that there is no constraint."""

    prior: float


@dataclass(frozen=True)
class CalibrationSettings:
    """Sets of demonstrations of a simulated world, and how many of each set are seen."""

    sets: int
    demonstrations: tuple[int, ...]


@dataclass(frozen=True)
class RankSettings:
    """Ranks of the truth over random subsets of 1 .. `demonstrations` demonstrations."""

    demonstrations: int
    subsets: int
    top: int


@dataclass(frozen=True)
class SubjectSettings:
    """A system, what it can do, and the hypotheses about it."""

    system: SystemSettings
    actions: int | tuple[int, ...]
    hypotheses: HypothesesSettings

    @cached_property
    def model(self) -> System:
        """The system, built."""
        return self.system.build()

    @cached_property
    def candidates(self) -> ConstraintSet:
        """The hypotheses."""
        return self.hypotheses.regions(self.model.space)

    @property
    def action_counts(self) -> tuple[int, ...]:
        """(m,) number of actions along each control."""
        if isinstance(self.actions, int):
            return (self.actions,) * self.model.control_box.dimension
        return self.actions


@dataclass(frozen=True)
class ModelSettings(SubjectSettings):
    """The tabular model of a system and the hypotheses about it."""

    grid: GridSettings
    dt: float
    transition: TransitionSettings
    temperature: float
    inference: InferenceSettings

    @cached_property
    def cells(self) -> Grid:
        """The grid of the tabular model."""
        return Grid(self.model.space, self.grid.shape, self.grid.offset or ())


@dataclass(frozen=True)
class Settings(ModelSettings):
    """All that decides the result of one point, and nothing else."""

    tasks: TaskSettings
    truth: TruthSettings
    horizon: float
    demonstrations: DemonstrationSettings
    safety: SafetySettings
    ranks: RankSettings
    calibration: CalibrationSettings
    rollouts: int
    seed: int

    @cached_property
    def constraint(self) -> ConstraintSet:
        """The true constraint; a set of no regions where there is none."""
        boxes = [region.box() for region in self.truth.boxes]
        if self.truth.cell is not None:
            boxes = [self.candidates.box(self.truth.cell)]
        return ConstraintSet.from_boxes(self.model.space, boxes)

    @property
    def columns(self) -> dict[str, str | int | float]:
        """The values that open every row of this point's tables."""
        actions = self.actions
        return {
            "truth": self.truth.label,
            "cells": math.prod(self.grid.shape),
            "actions": actions if isinstance(actions, int) else "x".join(map(str, actions)),
            "dt": self.dt,
            "samples": self.transition.samples,
            "seed": self.seed,
        }


@dataclass(frozen=True)
class RecordedSettings(ModelSettings):
    """Inference from recorded demonstrations; conf/infer.yaml explains every value."""

    demonstrations: str | tuple[str, ...]
    recorded_dt: float
    start: tuple[float, ...] | None
    goal: Region | None
    round_horizon: bool
    top: int
    results: str | None


@dataclass(frozen=True)
class AdviceSettings(SubjectSettings):
    """Which discretisations to compare; conf/advise.yaml explains every value."""

    tasks: TaskSettings
    grid: GridSettings
    grids: tuple[tuple[int, ...], ...] | None
    dts: tuple[float, ...]
    budget: int
    remedy: int
    horizon: float
    pairs: int
    seed: int

    @property
    def grids_to_try(self) -> list[Grid]:
        """The grids within the budget, small ones first."""
        shapes = self.grids
        if shapes is None:
            scaled = [[round(m * count) for count in self.grid.shape] for m in (0.5, 1, 1.5, 2)]
            shapes = tuple(tuple(max(1, count) for count in shape) for shape in scaled)
        shift = self.grid.offset or ()
        grids = [Grid(self.model.space, shape, shift) for shape in dict.fromkeys(shapes)]
        return sorted((g for g in grids if g.size <= self.budget), key=lambda grid: grid.size)


@dataclass(frozen=True)
class SweepSettings:
    """Which points of a sweep run, and what is done about those that fail.

    Attributes:
        only: run points in these states alone; None for all that are not done.
        force: run points even if they are done.
        limit: run at most so many points.
        time_limit: [s] that a point may take.
        retries: how often a point that failed is tried again.
        fail_fast: start no point after one has failed.
        dry_run: show the points with their states, and run none.
        mix_sources: tables may join points of different versions of the source.
    """

    only: tuple[str, ...] | None
    force: bool
    limit: int | None
    time_limit: float | None
    retries: int
    fail_fast: bool
    dry_run: bool
    mix_sources: bool


@dataclass(frozen=True)
class StudySettings:
    """Where and how points run: it changes no result, so it is no part of a point's identity."""

    study: str
    case: str | None
    results: str | None
    workers: int | None
    examples: Mapping[str, Any]
    sweep: SweepSettings


def system_class(target: str) -> type[System]:
    """The concrete System that a dotted path names.

    Raises:
        ValueError: it cannot be imported, or is something else.
    """
    module_name, _, name = target.rpartition(".")
    try:
        module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # it may be anybody's module
        raise ValueError(f"{target!r} cannot be imported: {_words(error, module_name)}") from None
    found = getattr(module, name, None)
    if found is None:
        where = getattr(module, "__file__", None) or module_name
        raise ValueError(f"{target!r} cannot be imported: {where} defines no {name}")
    if not (inspect.isclass(found) and issubclass(found, System)) or found is System:
        raise ValueError(f"{target!r} is not a subclass of mlci.systems.System")
    if missing := ", ".join(sorted(found.__abstractmethods__)):
        raise ValueError(f"{target!r} does not define {missing}")
    return found


def _words(error: BaseException, module_name: str) -> str:
    """Why a module cannot be imported, and where."""
    if isinstance(error, ModuleNotFoundError) and error.name == module_name.partition(".")[0]:
        return f"there is no module {error.name} in {Path.cwd()}, nor installed"
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if "importlib" not in frame.filename][1:]  # 0 is ours
    where = "".join(f"{frame.filename}, line {frame.lineno}: " for frame in own[-1:])
    return where + " ".join(f"{type(error).__name__}: {error}".split())
