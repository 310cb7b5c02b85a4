"""What is wrong with the truth, the safe set that keeps out of it, and its tasks.

Each check yields a line for each fault: the key, the value and the way out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from experiments.config.settings import BARRIER, ESCAPES, NO_TRUTH, Settings
from experiments.tracking.names import is_name
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.spaces import Box
from mlci.system_check import check_affine

_PROBES = 1000  # random states; a truth that holds all of them leaves no room
_MOST_VALUES = 100_000_000  # of a safe set's grid: about 1 GB for each of its arrays


def truth_problems(settings: Settings) -> Iterator[str]:
    """A truth that is given twice or not at all, and what needs a truth, or none."""
    truth, calibration = settings.truth, settings.calibration
    if not is_name(truth.name):
        yield (
            f"truth.name: {truth.name!r} cannot be part of a file's name; use letters, digits, "
            "- and _"
        )
    no_regions = not truth.count and truth.cell is None
    if settings.tasks.crossing and no_regions:
        yield "tasks.crossing: true, but no truth is there to cross; set it to false"
    if settings.demonstrations.rule_breaking and truth.name == NO_TRUTH:
        yield (
            f"demonstrations.rule_breaking: {settings.demonstrations.rule_breaking}, but no truth "
            "is there to break; set it to 0"
        )
    nothing = no_regions and not truth.controls
    if nothing and truth.name != NO_TRUTH:
        yield (
            "truth.boxes: [] is empty; give at least one box, with lower and upper, or another "
            f"region, a cell or controls, or choose truth={NO_TRUTH}"
        )
    if truth.name == NO_TRUTH and not nothing:
        yield f"truth.name: {NO_TRUTH} means that nothing is forbidden; take another name"
    if truth.cell is not None and truth.count:
        yield f"truth.cell: {truth.cell} and {truth.count} regions are given; keep one of them"
    if calibration.sets and (truth.count or truth.controls):
        yield (
            f"calibration.sets: {calibration.sets}, but the prior knows no such truth; take "
            "truth=none or truth=cell, or 0 sets"
        )
    if calibration.sets and settings.inference.size_prior:
        yield (
            f"calibration.sets: {calibration.sets}, but truths are drawn as equally probable, not "
            f"by inference.size_prior={settings.inference.size_prior:g}; set that to 0, or 0 sets"
        )
    if no_regions:
        yield from _questions_without_regions(settings)
    for i, region in enumerate(truth.boxes):
        if all(side is None for side in region.lower):
            yield f"truth.boxes[{i}]: forbids every state; give ends to at least one dimension"


def _questions_without_regions(settings: Settings) -> Iterator[str]:
    """What is asked of a true region, where none is forbidden."""
    asked = {
        "next_task.repetitions": (settings.next_task.repetitions, 0),
        "areas.subsets": (settings.areas.subsets, 0),
        "soft.weights": (list(settings.soft.weights), []),
        "transfer.strengths": (list(settings.transfer.strengths), []),
    }
    for key, (value, nothing) in asked.items():
        if value:
            yield f"{key}: {value}, but no truth is there to ask about; set it to {nothing}"


def hypothesis_problems(settings: Settings) -> Iterator[str]:
    """A truth that no hypothesis stands for."""
    count = len(settings.candidates)
    if settings.truth.is_drawn:
        return
    if settings.truth.number is not None and settings.truth.number >= count:
        yield (
            f"truth.cell: {settings.truth.number} is not the number of a hypothesis; there are "
            f"{count}, from 0 to {count - 1}"
        )
        return
    constraint = settings.constraint
    if len(constraint) and not np.any(settings.candidates.inside(constraint)):
        yield (
            f"truth: {settings.truth.name} covers no hypothesis entirely, so none can be ranked as "
            "the truth; choose boxes that hold a whole cell of hypotheses.shape, or refine that"
        )


def safe_set_problems(settings: Settings) -> Iterator[str]:
    """A wide border, dynamics without a safe set, and a grid that is too fine or too coarse."""
    safety, space = settings.safety, settings.model.space
    # One that is drawn is some hypothesis, none of which holds all states but where it is alone.
    possible = settings.candidates if settings.truth.is_drawn else settings.constraint
    if len(possible):
        states = np.random.default_rng(0).uniform(
            space.bounds.lower, space.bounds.upper, (_PROBES, space.dimension)
        )
        try:
            distances = possible.signed_distance(states)
        except ValueError as error:
            yield f"truth.shapes: {error}"
            return
        if np.all(distances <= 0) and not settings.truth.is_drawn:
            yield f"truth.boxes: {settings.truth.name} forbids every state; make its boxes smaller"
            return
        try:
            check_affine(settings.real_model)
        except ValueError as error:
            yield f"truth: {settings.truth.name} needs a safe set, but {error}; or take truth=none"
    widest = float(np.max(space.bounds.widths))
    for key, value in (("margin", safety.margin), ("width", safety.width)):
        if value is not None and value > widest:
            yield (
                f"safety.{key}: {value:g} is more than the state space is wide, {widest:.6g}; "
                "lower it"
            )
    if safety.method == BARRIER:
        yield from _barrier_problems(settings, possible)
    elif math.prod(safety.shape) > _MOST_VALUES:
        yield f"safety.shape: {list(safety.shape)} makes too many values; use fewer"
    elif safety.method != ESCAPES:
        yield from _coarse_grid_problems(possible, Grid(space, safety.shape))


def _barrier_problems(settings: Settings, possible: Regions) -> Iterator[str]:
    """What a barrier knows no way for: other systems and truths, limits of torques, a blend."""
    if len(possible):
        try:
            settings.safety.barrier(
                settings.real_system.build(), possible, settings.demonstrations.dt
            )
        except ValueError as error:
            yield (
                f"safety.method: barrier, but {error}; take escapes, or equation where a grid can "
                "hold the state space"
            )
    if settings.control_limit is not None:
        yield (
            "safety.method: barrier, but it brakes with any torque, and demonstrations.clip or "
            "truth.controls limit these; take escapes, or lift the limit"
        )
    if settings.safety.width:
        yield f"safety.width: {settings.safety.width:g}, but a barrier has no blend; set it to 0"


def _coarse_grid_problems(truth: Regions, grid: Grid) -> Iterator[str]:
    """Regions of a truth that lie between the centres of the safe set's cells."""
    shape = list(grid.shape)
    for i in range(len(truth)):
        if not truth.are_boxes[i]:
            if np.all(truth.shape(i).level(grid.space, grid.centers) >= 0):
                yield (
                    f"safety.shape: {shape} has no cell centre inside the truth's region {i}; use "
                    "more cells"
                )
        elif names := " and ".join(_missed(truth.box(i), grid)):
            yield (
                f"safety.shape: {shape} has no cell centre inside the truth's box {i} along "
                f"{names}; use more cells"
            )


def _missed(box: Box, grid: Grid) -> Iterator[str]:
    """The dimensions along which no cell centre of a grid lies inside a box."""
    space, bounds = grid.space, grid.space.bounds
    lower = np.where(np.isfinite(box.lower), box.lower, bounds.lower)
    middle = (lower + np.where(np.isfinite(box.upper), box.upper, bounds.upper)) / 2
    for d, centres in enumerate(grid.axes):
        states = np.tile(middle, (len(centres), 1))
        states[:, d] = centres
        if not np.any(space.signed_distance(states, box) < 0):
            yield space.names[d]
