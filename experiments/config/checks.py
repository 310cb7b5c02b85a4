"""What can be wrong with settings beyond their types: ranges, shapes and regions.

Each check yields a line for each fault: the key, the value and the way out. Checks that look at the
system rely on those that come before them in `experiments.config.read`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from itertools import chain
from typing import Any

import numpy as np

from experiments.config.memory import expected_memory, machine_memory
from experiments.config.settings import (
    NO_TRUTH,
    AdviceSettings,
    GridSettings,
    ModelSettings,
    RecordedSettings,
    Region,
    Settings,
    StudySettings,
    SubjectSettings,
    TaskSettings,
)
from experiments.tracking.trees import plain
from mlci.spaces import StateSpace

_MOST_STEPS = 100_000
_MOST_COUNT = 1_000_000  # of trials, rollouts and the like
_MOST_VALUES = 100_000_000  # of a safe set's grid: about 1 GB for each of its arrays

_LONGEST = 1e8  # [s], three years
_TAKEN = ("points", "store", "diffs", "inference")  # among the folders of results
_RUNNABLE = ("missing", "failed", "stale")
SAFE_SETS = ("equation", "escapes")

_POSITIVE = (
    "horizon",
    "dt",
    "temperature",
    "demonstrations.dt",
    "demonstrations.goal_tolerance",
    "demonstrations.goal_weight",
    "demonstrations.hold",
    "recorded_dt",
    "dts",
)
_NOT_NEGATIVE = (
    "seed",
    "safety.margin",
    "safety.width",
    "tasks.goal",
    "truth.cell",
    "calibration.sets",
)
_AT_LEAST_ONE = (
    "rollouts",
    "transition.samples",
    "demonstrations.pairs",
    "demonstrations.keep",
    "demonstrations.restarts",
    "demonstrations.iterations",
    "ranks.demonstrations",
    "ranks.subsets",
    "ranks.top",
    "calibration.demonstrations",
    "grid.shape",
    "safety.shape",
    "hypotheses.shape",
    "actions",
    "top",
    "budget",
    "remedy",
    "pairs",
    "grids",
)


def study_problems(study: StudySettings) -> Iterator[str]:
    """What is out of range in the settings that change no result."""
    if not re.fullmatch(r"[A-Za-z0-9_-]+", study.study) or study.study in _TAKEN:
        yield (
            f"study: {study.study!r} cannot name a folder of results; use letters, digits, - and _ "
            f"({', '.join(_TAKEN)} are taken)"
        )
    if study.workers is not None and study.workers < 1:
        yield f"workers: {study.workers} must be at least 1; null takes one process a core"
    sweep = study.sweep
    for state in sweep.only or ():
        if state not in _RUNNABLE:
            yield f"sweep.only: {state!r} is none of {', '.join(_RUNNABLE)}"
    if sweep.only is not None and sweep.force:
        yield "sweep.force: it runs points in every state; give it without sweep.only"
    if sweep.limit is not None and sweep.limit < 1:
        yield f"sweep.limit: {sweep.limit} must be at least 1; null is no limit"
    if sweep.time_limit is not None and not 0 < sweep.time_limit <= _LONGEST:
        yield f"sweep.time_limit: {sweep.time_limit} must lie between 0 and {_LONGEST:.0f} s"
    if sweep.retries < 0:
        yield f"sweep.retries: {sweep.retries} must not be below 0"
    if sweep.retries and sweep.fail_fast:
        yield "sweep.retries: nothing is tried again with sweep.fail_fast; give one of them"


def number_problems(settings: ModelSettings) -> Iterator[str]:
    """What is out of range without looking at the system."""
    yield from _range_problems(settings)
    if not 0 < settings.inference.prior < 1:
        yield f"inference.prior: {settings.inference.prior} must lie between 0 and 1, ends excluded"


def advice_number_problems(settings: AdviceSettings) -> Iterator[str]:
    """What is out of range without looking at the system, where discretisations are compared."""
    yield from _range_problems(settings)
    for dt in settings.dts:
        if dt > 0 and settings.horizon > 0:
            yield from _division_problems("dts", dt, settings.horizon)


def _range_problems(settings: SubjectSettings) -> Iterator[str]:
    """Single numbers out of range."""
    yield from _limit(settings, _POSITIVE, lambda value: value > 0, "must be above 0")
    yield from _limit(settings, _NOT_NEGATIVE, lambda value: value >= 0, "must not be below 0")
    yield from _limit(settings, _AT_LEAST_ONE, lambda value: value >= 1, "must be at least 1")
    yield from _limit(
        settings, _AT_LEAST_ONE, lambda value: value <= _MOST_COUNT, f"is above {_MOST_COUNT}"
    )


def count_problems(settings: Settings) -> Iterator[str]:
    """Numbers of a study that do not go together."""
    demonstrations = settings.demonstrations
    if demonstrations.keep > demonstrations.pairs:
        yield (
            f"demonstrations.keep: {demonstrations.keep} is more than the {demonstrations.pairs} "
            "of demonstrations.pairs; lower it, or raise pairs"
        )
    for key, dt in (("dt", settings.dt), ("demonstrations.dt", demonstrations.dt)):
        if dt > 0 and settings.horizon > 0:
            yield from _division_problems(key, dt, settings.horizon)


def _limit(
    settings: SubjectSettings, keys: tuple[str, ...], holds: Callable[[Any], bool], rule: str
) -> Iterator[str]:
    """A message for each key whose value, or an entry of it, breaks a rule."""
    for key in keys:
        value: Any = settings
        for part in key.split("."):
            value = getattr(value, part, None)  # not every kind of settings has every key
        if value == ():
            yield f"{key}: [] is empty; give a number for each dimension"
        entries = value if isinstance(value, tuple) else (value,)
        if any(isinstance(entry, tuple) for entry in entries):
            entries = tuple(chain.from_iterable(entries))
        if not all(entry is None or holds(entry) for entry in entries):
            yield f"{key}: {plain(value)} {rule}"


def _division_problems(key: str, dt: float, horizon: float) -> Iterator[str]:
    """The horizon has to be a whole number of steps."""
    steps = horizon / dt
    if steps > _MOST_STEPS:
        yield f"{key}: {dt} cuts the horizon {horizon} into more than {_MOST_STEPS} steps; raise it"
    elif round(steps) < 1 or abs(steps - round(steps)) > 1e-9 * steps:
        below = (horizon / count for count in range(math.floor(steps) + 1, 2 * _MOST_STEPS))
        above = (horizon / count for count in range(math.floor(steps), 0, -1))
        near = [next(filter(_is_short, values), None) for values in (below, above)]
        ways = " or ".join(f"{value:.4g}" for value in near if value is not None)
        yield f"{key}: {dt} does not cut the horizon {horizon} into whole steps; try {ways}"


def _is_short(value: float) -> bool:
    """Whether four digits write a number exactly, as far as a whole number of steps needs it."""
    return math.isclose(float(f"{value:.4g}"), value, rel_tol=1e-12)


def shape_problems(settings: ModelSettings) -> Iterator[str]:
    """What does not match the system's dimensions and bounds."""
    yield from _grid_problems(settings.grid, settings.model.space)
    yield from _subject_problems(settings)


def advice_problems(settings: AdviceSettings) -> Iterator[str]:
    """What does not match the system's dimensions and bounds, or the budget."""
    space = settings.model.space
    before = [
        *_grid_problems(settings.grid, space),
        *(
            message
            for i, shape in enumerate(settings.grids or ())
            for message in _length_problems(f"grids[{i}]", shape, space)
        ),
        *_subject_problems(settings),
        *_task_region_problems(settings.tasks, space),
    ]
    yield from before
    if not before and not settings.grids_to_try:
        yield f"budget: {settings.budget} states hold none of the grids; raise it, or set grids"


def _grid_problems(grid: GridSettings, space: StateSpace) -> Iterator[str]:
    """Cells that do not match the state space."""
    yield from _length_problems("grid.shape", grid.shape, space)
    yield from _offset_problems(grid.offset, space)


def _subject_problems(settings: SubjectSettings) -> Iterator[str]:
    """Actions and hypotheses that do not match the system."""
    space, controls = settings.model.space, settings.model.control_box.dimension
    if settings.hypotheses.shape is not None:
        yield from _length_problems("hypotheses.shape", settings.hypotheses.shape, space)
    if not isinstance(settings.actions, int) and len(settings.actions) != controls:
        yield f"actions: {list(settings.actions)} must be one number, or a list of {controls}"
    for i, region in enumerate(settings.hypotheses.boxes):
        yield from _region_problems(f"hypotheses.boxes[{i}]", region, space)
    if settings.hypotheses.shape is None and not settings.hypotheses.boxes:
        yield "hypotheses: no shape and no boxes; give a shape, for a grid of cells, or boxes"


def _offset_problems(offset: tuple[float, ...] | None, space: StateSpace) -> Iterator[str]:
    """Cells can be shifted in periodic dimensions only, by less than a cell."""
    if offset is None:
        return
    yield from _length_problems("grid.offset", offset, space)
    for share, periodic, name in zip(offset, space.periodic, space.names, strict=False):
        if not 0 <= share < 1:
            yield f"grid.offset: {list(offset)} must be shares of a cell, from 0 to below 1"
        elif share and not periodic:
            yield f"grid.offset: {list(offset)} shifts {name}, which has ends; give it 0"


def truth_shape_problems(settings: Settings) -> Iterator[str]:
    """What a study has of regions beside the hypotheses."""
    space = settings.model.space
    yield from _length_problems("safety.shape", settings.safety.shape, space)
    yield from _task_region_problems(settings.tasks, space)
    if settings.safety.method not in SAFE_SETS:
        yield f"safety.method: {settings.safety.method!r} is none of {', '.join(SAFE_SETS)}"
    for i, region in enumerate(settings.truth.boxes):
        yield from _region_problems(f"truth.boxes[{i}]", region, space)
    truth = settings.truth
    if settings.tasks.crossing and truth.name == NO_TRUTH:
        yield "tasks.crossing: true, but no truth is there to cross; set it to false"
    nothing = not truth.boxes and truth.cell is None
    if nothing and truth.name != NO_TRUTH:
        yield (
            "truth.boxes: [] is empty; give at least one box, with lower and upper, or a cell, or "
            f"choose truth={NO_TRUTH}"
        )
    if truth.name == NO_TRUTH and not nothing:
        yield f"truth.name: {NO_TRUTH} means that nothing is forbidden; take another name"
    if truth.cell is not None and truth.boxes:
        yield f"truth.cell: {truth.cell} and {len(truth.boxes)} boxes are given; keep one of them"


def _task_region_problems(tasks: TaskSettings, space: StateSpace) -> Iterator[str]:
    """A box of tasks, or the reach of their goals, that does not fit the state space."""
    yield from _region_problems("tasks", tasks, space, point=True)
    if tasks.goal is not None:
        yield from _length_problems("tasks.goal", tasks.goal, space)


def task_problems(settings: RecordedSettings) -> Iterator[str]:
    """A start or goal that does not fit the state space."""
    space = settings.model.space
    if settings.start is not None:
        yield from _length_problems("start", settings.start, space)
    if settings.goal is not None:
        yield from _region_problems("goal", settings.goal, space, point=True)


def _length_problems(key: str, entries: tuple[Any, ...], space: StateSpace) -> Iterator[str]:
    """A list must have an entry for each dimension of the state space."""
    if len(entries) != space.dimension:
        names = ", ".join(space.names)
        yield f"{key}: {list(entries)} must have {space.dimension} entries, one each for {names}"


def _region_problems(
    key: str, region: Region, space: StateSpace, point: bool = False
) -> Iterator[str]:
    """A box must match the state space, be ordered and lie inside; some may be a `point`."""
    if len(region.lower) != space.dimension or len(region.upper) != space.dimension:
        yield from _length_problems(f"{key}.lower", region.lower, space)
        yield from _length_problems(f"{key}.upper", region.upper, space)
        return
    for d, (low, high) in enumerate(zip(region.lower, region.upper, strict=True)):
        name, first, last = space.names[d], space.bounds.lower[d], space.bounds.upper[d]
        if low is None and high is None:
            continue
        if low is None or high is None:
            yield f"{key}: {name} has one side only; give both ends, or null twice to leave it free"
        elif low > high or (low == high and not point):
            yield f"{key}: {name} goes from {low} to {high}; lower must be below upper"
        elif space.periodic[d] and high - low > (last - first) * (1 + 1e-12):
            yield f"{key}: {name} from {low:.6g} to {high:.6g} is over a whole turn; use null twice"
        elif not space.periodic[d] and (low < first or high > last):
            yield (
                f"{key}: {name} from {low:.6g} to {high:.6g} leaves the state space "
                f"[{first:.6g}, {last:.6g}]; move it inside, or choose another {key.split('.')[0]}"
            )


def size_problems(settings: ModelSettings) -> Iterator[str]:
    """What is too large to hold."""
    needed, there = expected_memory(settings) / 1e9, machine_memory() / 1e9
    if needed > there:
        yield (
            f"grid.shape: {list(settings.grid.shape)} with {list(settings.action_counts)} actions, "
            f"{settings.transition.samples} samples and these hypotheses takes about {needed:.3g} "
            f"GB, and this machine has {there:.3g}; use fewer cells, actions, samples or hypotheses"
        )


def truth_problems(settings: Settings) -> Iterator[str]:
    """A value grid that is too large, and a truth that no hypothesis stands for."""
    count = len(settings.candidates)
    if settings.truth.cell is not None and settings.truth.cell >= count:
        yield (
            f"truth.cell: {settings.truth.cell} is not the number of a hypothesis; there are "
            f"{count}, from 0 to {count - 1}"
        )
        return
    if math.prod(settings.safety.shape) > _MOST_VALUES:
        yield f"safety.shape: {list(settings.safety.shape)} makes too many values; use fewer"
    if settings.calibration.sets and settings.truth.boxes:
        yield (
            f"calibration.sets: {settings.calibration.sets}, but the prior knows no such truth; "
            "take truth=none or truth=cell, or 0 sets"
        )
    constraint = settings.constraint
    if len(constraint) and not np.any(settings.candidates.inside(constraint)):
        yield (
            f"truth: {settings.truth.name} covers no hypothesis entirely, so none can be ranked as "
            "the truth; choose boxes that hold a whole cell of hypotheses.shape, or refine that"
        )
