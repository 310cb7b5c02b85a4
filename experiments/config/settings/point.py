"""All that decides the result of a point, and what it shares with the other commands."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field
from pydantic.dataclasses import dataclass

from experiments.config.settings.areas import AreaSettings
from experiments.config.settings.baselines import BaselineSettings
from experiments.config.settings.cells import GridSettings, Shape, TransitionSettings
from experiments.config.settings.constraint import SoftSettings, TransferSettings
from experiments.config.settings.controls import ranges_of
from experiments.config.settings.dynamics import DynamicsSettings
from experiments.config.settings.kinds import (
    STRICT,
    Count,
    CountOrNone,
    Number,
    Positive,
    Seed,
    about,
    one_or_list,
)
from experiments.config.settings.parts import (
    CalibrationSettings,
    DemonstrationSettings,
    InferenceSettings,
    NextTaskSettings,
    RankSettings,
    TaskSettings,
)
from experiments.config.settings.reality import RealitySettings, read_reality
from experiments.config.settings.regions import HypothesesSettings, TruthSettings
from experiments.config.settings.resolution import ResolutionSettings
from experiments.config.settings.safety import SafetySettings
from experiments.config.settings.sampling import ModelsSettings, SampledSettings
from experiments.config.settings.shapes import ShapeList
from experiments.config.settings.system import SystemSettings, read_system
from mlci.actuation.limited import Limited
from mlci.control.effort import WithEffort
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.spaces import Box, Floats
from mlci.systems import System
from mlci.tabular import action_grid


@dataclass(frozen=True, config=STRICT)
class SubjectSettings:
    """A system, what it can do, and the hypotheses about it."""

    system: Annotated[
        SystemSettings,
        BeforeValidator(read_system),
        about("`_target_` names a class, whose constructor takes the other keys"),
    ]
    actions: Annotated[
        one_or_list(Count, Shape),  # type: ignore[valid-type]
        about("actions, evenly spaced over the control box; a list gives a number each control"),
    ]
    action_range: Annotated[
        tuple[Annotated[tuple[Number, ...], Field(min_length=2, max_length=2)], ...] | None,
        about(
            "first and last action of each control in place of the control box; null takes that",
            "of the control",
        ),
    ]
    hypotheses: HypothesesSettings

    @cached_property
    def model(self) -> System:
        """The system, built."""
        return self.system.build()

    @cached_property
    def candidates(self) -> Regions:
        """The hypotheses."""
        return self.hypotheses.regions(self.model.space)

    @property
    def shape_lists(self) -> tuple[ShapeList, ...]:
        """What lists regions."""
        return (self.hypotheses,)

    @property
    def action_values(self) -> Floats:
        """(A, m) the actions."""
        if self.action_range is None:
            return action_grid(self.model, self.action_counts)
        lower, upper = np.array(self.action_range).T
        return action_grid(self.model, self.action_counts, Box(lower, upper))

    @property
    def action_counts(self) -> tuple[int, ...]:
        """(m,) number of actions along each control."""
        if isinstance(self.actions, int):
            return (self.actions,) * self.model.control_box.dimension
        return self.actions


@dataclass(frozen=True, config=STRICT)
class ModelSettings(SubjectSettings):
    """The tabular model of a system and the hypotheses about it."""

    grid: GridSettings
    dt: Annotated[Positive, about("time step of the tabular model; it divides the horizon", "s")]
    transition: TransitionSettings
    temperature: Annotated[
        Positive, about("of the maximum entropy model: larger is closer to random")
    ]
    inference: InferenceSettings
    sampled: SampledSettings

    @property
    def sampling(self) -> SampledSettings | None:
        """How paths are sampled; None where there are cells."""
        return self.sampled if self.sampled.use else None

    @property
    def action_box(self) -> Box:
        """The range of the controls: that of the actions, or the control box."""
        if self.action_range is None:
            return self.model.control_box
        return Box(*np.array(self.action_range).T)

    @cached_property
    def cells(self) -> Grid:
        """The grid of the tabular model."""
        return Grid(self.model.space, self.grid.shape, self.grid.offset or ())


@dataclass(frozen=True, config=STRICT)
class Settings(ModelSettings):
    """All that decides the result of one point, and nothing else."""

    tasks: TaskSettings
    truth: TruthSettings
    horizon: Annotated[Positive, about("duration of a task", "s")]
    demonstrations: DemonstrationSettings
    reality: Annotated[RealitySettings, BeforeValidator(read_reality)]
    safety: SafetySettings
    ranks: RankSettings
    calibration: CalibrationSettings
    baselines: BaselineSettings
    next_task: NextTaskSettings
    areas: AreaSettings
    soft: SoftSettings
    transfer: TransferSettings
    dynamics: DynamicsSettings
    models: ModelsSettings
    resolution: ResolutionSettings
    rollouts: Annotated[
        CountOrNone,
        about(
            "sampled policies executed on the true dynamics for each demonstration; 0 measures "
            "nothing of the tabular agent under the truth"
        ),
    ]
    misfit: Annotated[
        CountOrNone,
        about(
            "trajectories of the tabular model that each demonstration is compared with, to tell "
            "whether it is nearly impossible there; 0 compares none"
        ),
    ]
    seed: Annotated[Seed, about("of all that is random")]

    @cached_property
    def constraint(self) -> Regions:
        """The true constraint; a set of no regions where there is none.

        Raises:
            ValueError: it is drawn when the point runs.
        """
        shapes = self.truth.listed()
        if self.truth.number is not None:
            shapes = [self.candidates.shape(self.truth.number)]
        names = [f"truth_{number}" for number in range(len(shapes))]
        return Regions.from_shapes(self.model.space, shapes, names)

    @cached_property
    def control_limit(self) -> Box | None:
        """Range of the controls of those who keep to the truth; None for no limit.

        Raises:
            ValueError: forbidden ranges that leave no box.
        """
        box = limit = self.model.control_box if self.demonstrations.clip else None
        if self.truth.controls:
            far = np.full(self.model.control_box.dimension, np.inf)
            limit = ranges_of(self.truth.controls, self.model).left_by_all(box or Box(-far, far))
        return limit

    @property
    def shape_lists(self) -> tuple[ShapeList, ...]:
        """See `SubjectSettings.shape_lists`."""
        return self.hypotheses, self.truth

    @property
    def real_system(self) -> SystemSettings:
        """The system as demonstrators know it: class and arguments."""
        return self.reality.changed(self.system)

    @cached_property
    def real_model(self) -> System:
        """What demonstrators move and what they maximise; `model` is what inference assumes."""
        system, effort = self.real_system.build(), self.reality.effort
        return system if effort is None else WithEffort(system, np.array(effort))

    @cached_property
    def limited_model(self) -> System:
        """The same under the limit of those who keep to the truth, whose safe set it has.

        Raises:
            ValueError: forbidden ranges that leave no box, or nothing of the control range.
        """
        limit = self.control_limit if self.truth.controls else None
        return self.real_model if limit is None else Limited(self.real_model, limit)

    @property
    def columns(self) -> dict[str, str | int | float]:
        """The values that open every row of this point's tables; 0 for cells that are not."""
        actions = self.actions
        if self.sampled.use:
            kind = {"cells": 0, "actions": 0, "dt": self.dt, "samples": 0}
            return {"truth": self.truth.label, **kind, "seed": self.seed}
        return {
            "truth": self.truth.label,
            "cells": self.grid.refined or math.prod(self.grid.shape),
            "actions": actions if isinstance(actions, int) else "x".join(map(str, actions)),
            "dt": self.dt,
            "samples": self.transition.samples,
            "seed": self.seed,
        }
