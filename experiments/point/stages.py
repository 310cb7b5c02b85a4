"""The safe set and the tabular model, kept in the store by the content of what they depend on.

The safe set of a truth is computed once for all grids, time steps and action counts; the tabular
model once for all truths, seeds and tasks. `trials` has the stage between them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
from scipy import sparse

import mlci.safety.constant_controls
import mlci.safety.reachability
import mlci.shapes.balls
import mlci.shapes.half_spaces
import mlci.tabular
from experiments.config.settings import ESCAPES, ModelSettings, Settings, ShapeList, SubjectSettings
from experiments.point.no_answer import NoAnswer
from experiments.terminal import entry
from experiments.tracking.store import Store, Stored
from mlci.cells.refined_model import RefinedModel
from mlci.grids import Grid
from mlci.models import Model
from mlci.paths import substep_count
from mlci.regions import Regions
from mlci.safety.constant_controls import tabulate_escapes
from mlci.safety.reachability import NotSettled, SafeSet, solve_safe_set
from mlci.sampled.model import SampledModel
from mlci.single_moves import SingleMoves
from mlci.systems import System
from mlci.tabular import TabularModel, discretize, moves_are_kept

# What is stored of the moves of a tabular model, and of the sparse matrix of their crossings.
_MOVES = ("successor", "reward")
_CROSSINGS = ("indices", "indptr")
_MANY_STEPS = 1e7  # of the dynamics while cells are formed; an arm of two links takes 1 us each


def safe_set_inputs(settings: Settings) -> tuple[Any, ...]:
    """All that the safe set depends on, beside code."""
    method, horizon = settings.safety.method, settings.horizon
    return (
        settings.real_system,
        settings.truth.controls,
        region_inputs(settings, settings.constraint),
        method,
        settings.safety.shape,
        horizon if method == ESCAPES else None,  # the equation's solution is converged
    )


def safe_set(settings: Settings, store: Store) -> tuple[SafeSet, str]:
    """Omega of a truth (10) as demonstrators know it, stored or computed, and its key."""
    grid, escapes = Grid(settings.model.space, settings.safety.shape), mlci.safety.constant_controls
    source = escapes if settings.safety.method == ESCAPES else mlci.safety.reachability

    def compute() -> dict[str, np.ndarray]:
        system, truth = settings.limited_model, settings.constraint
        if source is escapes:
            safe = tabulate_escapes(system, grid, truth, horizon=settings.horizon)
        else:
            safe = settled_safe_set(system, grid, truth, "safety.method: equation")
        return {"values": safe.values, "gradients": safe.gradients}

    modules = [source, system_module(settings.model), *shape_modules(settings, settings.constraint)]
    stored = store.get("safe_set", safe_set_inputs(settings), modules, compute)
    return SafeSet(grid, stored["values"], stored["gradients"]), stored.key


def settled_safe_set(system: System, grid: Grid, region: Regions, asked: str) -> SafeSet:
    """The safe set of a region on a grid, as the config asks in some words.

    Raises:
        NoAnswer: there is none within the longest time that is tried.
    """
    try:
        return solve_safe_set(system, grid, region)
    except NotSettled as error:
        raise NoAnswer(
            f"{asked}: no safe set is found where controls reach {_ends(system)}: {error}; take "
            "stronger controls, or fewer cells in safety.shape"
        ) from error


def _ends(system: System) -> str:
    """The largest controls of a system, as one reads them."""
    return ", ".join(f"{each:g}" for each in system.control_box.upper)


def inference_model(settings: Settings, store: Store) -> Model:
    """What tells how probable regions are; its regions are the hypotheses and then the truth's."""
    regions = settings.candidates.joined(settings.constraint)
    if settings.sampling is None and not settings.grid.refined:
        return tabular_model(settings, store)
    return formed_model(settings, regions)


def formed_model(settings: ModelSettings, regions: Regions) -> Model:
    """The same with some regions, formed anew."""
    if settings.sampling is not None:
        return sampled_model(settings, regions)
    if settings.grid.refined:
        return RefinedModel(model_of_cells(settings, regions), settings.grid.refined)
    return discretized_model(settings, regions)


def sampled_model(settings: ModelSettings, regions: Regions) -> SampledModel:
    """The model that samples paths, with some regions.

    Raises:
        ValueError: the settings ask for cells.
    """
    asked = settings.sampling
    if asked is None:
        raise ValueError("these settings ask for cells: sampled is null")
    return SampledModel(
        system=settings.model,
        regions=regions,
        dt=settings.dt,
        temperature=settings.temperature,
        samples=asked.samples,
        substeps=asked.substeps,
        restarts=asked.restarts,
        tolerance=asked.tolerance,
        limit=settings.action_box if asked.limited else None,
    )


def tabular_model(settings: Settings, store: Store) -> TabularModel:
    """The tabular model (1); its regions are the hypotheses and then the truth's boxes."""
    hypotheses, truth = settings.candidates, settings.constraint
    model = model_of_cells(settings, hypotheses.joined(truth))
    if not moves_are_kept(model.states, model.moves):
        return discretized_model(settings, model.regions)
    stored = _discretized(settings, store, "mdp", hypotheses, (*_MOVES, *_CROSSINGS))
    # Apart, so that points which differ in the truth share what takes the time.
    apart = _discretized(settings, store, "mdp_truth", truth, _CROSSINGS)
    crosses = [
        sparse.csr_matrix(
            (np.ones(len(each["indices"]), dtype=bool), each["indices"], each["indptr"]),
            shape=(stored["successor"].size, len(regions)),
        )
        for each, regions in ((stored, hypotheses), (apart, truth))
    ]
    joined = sparse.hstack(crosses, format="csr")
    return replace(model, kept=SingleMoves(stored["successor"], stored["reward"], joined))


def model_of_cells(settings: ModelSettings, regions: Regions) -> TabularModel:
    """The tabular model of equal cells with some regions, whose moves are not formed yet."""
    return TabularModel(
        system=settings.model,
        grid=settings.cells,
        actions=settings.action_values,
        dt=settings.dt,
        regions=regions,
        samples=settings.transition.samples,
        temperature=settings.temperature,
    )


def model_inputs(settings: ModelSettings, regions: Regions) -> tuple[Any, ...]:
    """All that the tabular model with the crossings of some regions depends on, beside code."""
    return (
        settings.system,
        settings.grid,
        settings.action_counts,
        settings.action_range,
        settings.dt,
        settings.transition.samples,
        settings.temperature,
        region_inputs(settings, regions),
    )


def _discretized(
    settings: Settings, store: Store, stage: str, regions: Regions, names: Sequence[str]
) -> Stored:
    """Arrays of the tabular model with the crossings of some regions, stored or computed."""

    def compute() -> dict[str, np.ndarray]:
        kept = discretized_model(settings, regions).kept
        assert kept is not None  # it is not too large
        arrays = {name: getattr(kept, name) for name in _MOVES}
        arrays |= {name: getattr(kept.crosses, name) for name in _CROSSINGS}
        return {name: arrays[name] for name in names}

    modules = [mlci.tabular, system_module(settings.model), sys.modules[__name__]]
    modules += shape_modules(settings, regions)
    return store.get(stage, model_inputs(settings, regions), modules, compute)


def cost_lines(settings: ModelSettings) -> list[str]:
    """What cells are going to cost where that is much, and what does without; else nothing."""
    if settings.sampling is not None:
        return []
    cells, actions = settings.cells, settings.action_values
    moves = cells.size * len(actions) * settings.transition.samples**cells.space.dimension
    steps = moves * substep_count(settings.model, cells, actions, settings.dt)
    if steps < _MANY_STEPS:
        return []
    return entry(
        "cells",
        f"{moves:.3g} moves take {steps:.3g} steps of the dynamics, and each task passes over them "
        "all: minutes, and hours where moves are 1e8. model=sampled does without cells; fewer of "
        "these, actions or transition.samples take less",
    )


def discretized_model(settings: ModelSettings, regions: Regions) -> TabularModel:
    """The tabular model with the crossings of some regions."""
    return discretize(
        settings.model,
        settings.cells,
        settings.action_values,
        settings.dt,
        regions,
        settings.transition.samples,
        settings.temperature,
    )


def region_inputs(settings: SubjectSettings, regions: Regions) -> list[Any]:
    """What decides regions: the corners of boxes, as words, since infinite sides are no JSON.

    A region that is no box may be one of a function, so that its settings decide.
    """
    sides = np.hstack([regions.lower, regions.upper])
    corners: list[Any] = [[repr(float(side)) for side in box] for box in sides]
    if regions.are_boxes.all():
        return corners
    kinds = [None if shape is None else type(shape).__name__ for shape in regions.shapes]
    return [corners, kinds, [listed.others for listed in _lists(settings, regions)]]


def shape_modules(settings: SubjectSettings, regions: Regions) -> list[ModuleType]:
    """The modules that define regions which are no boxes."""
    if regions.are_boxes.all():
        return []
    lists = _lists(settings, regions)
    own = {shape.target for listed in lists for shape in listed.shapes}
    makers = [sys.modules[target.rpartition(".")[0]] for target in sorted(own)]
    return [mlci.shapes.balls, mlci.shapes.half_spaces, *makers]


def _lists(settings: SubjectSettings, regions: Regions) -> tuple[ShapeList, ...]:
    """What lists regions: hypotheses do not depend on the truth, which may be one of them."""
    return (settings.hypotheses,) if regions is settings.candidates else settings.shape_lists


def system_module(system: System) -> ModuleType:
    """The module that defines a system."""
    return sys.modules[type(system).__module__]
