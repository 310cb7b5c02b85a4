"""What is wrong with numbers that do not go together, and with a study's options.

Types and ranges of single values stand beside the fields, in `experiments.config.settings`. Each
check yields a line for each fault: the key, the value and the way out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from experiments.config.memory import (
    expected_memory,
    machine_memory,
    resolution_memory,
    trial_memory,
)
from experiments.config.settings import (
    AdviceSettings,
    ModelSettings,
    RecordedSettings,
    Settings,
    StudySettings,
)
from mlci.tabular import MOST_KEPT, moves_are_kept

_MOST_STEPS = 100_000
_LONGEST_NAME = 200  # letters of a study; files of 255 bytes are named after it
_TAKEN = ("points", "store", "diffs", "inference", "trash")  # among the folders of results


def study_problems(study: StudySettings) -> Iterator[str]:
    """A name that cannot be a folder's, and options that exclude each other."""
    name = study.study
    if name is not None and (not re.fullmatch(r"[A-Za-z0-9_-]+", name) or name in _TAKEN):
        yield (
            f"study: {name!r} cannot name a folder of results; use letters, digits, - and _ "
            f"({', '.join(_TAKEN)} are taken)"
        )
    elif name is not None and len(name) > _LONGEST_NAME:
        yield (
            f"study: {name[:20]}... has {len(name)} letters, which a folder's name cannot; use at "
            f"most {_LONGEST_NAME}"
        )
    sweep = study.sweep
    if sweep.only is not None and sweep.force:
        yield "sweep.force: it runs points in every state; give it without sweep.only"
    if sweep.retries and sweep.fail_fast:
        yield "sweep.retries: nothing is tried again with sweep.fail_fast; give one of them"


def count_problems(settings: Settings) -> Iterator[str]:
    """More demonstrations than pairs, and time steps that do not divide the horizon."""
    demonstrations = settings.demonstrations
    if demonstrations.keep > demonstrations.pairs:
        yield (
            f"demonstrations.keep: {demonstrations.keep} is more than the {demonstrations.pairs} "
            "of demonstrations.pairs; lower it, or raise pairs"
        )
    yield from _division_problems("dt", settings.dt, settings.horizon)
    yield from _division_problems("demonstrations.dt", demonstrations.dt, settings.horizon)
    for i, step in enumerate(settings.models.steps):
        yield from _division_problems(f"models.steps[{i}]", step, settings.horizon)
    twice: dict[str, tuple[Any, ...]] = {
        "models.steps": settings.models.steps,
        "resolution.counts": settings.resolution.counts,
        "resolution.varying": settings.resolution.varying or (),
        "resolution.kinds": settings.resolution.kinds,
        "soft.weights": settings.soft.weights,
    }
    for key, values in twice.items():
        yield from _repeat_problems(key, values)


def _repeat_problems(key: str, values: Sequence[Any]) -> Iterator[str]:
    """A value that is given twice."""
    if len(set(values)) < len(values):
        yield f"{key}: {list(values)} holds a value twice; give each once"


def advice_count_problems(settings: AdviceSettings) -> Iterator[str]:
    """Time steps that do not divide the horizon, and what is compared with itself."""
    for i, dt in enumerate(settings.dts):
        yield from _division_problems(f"dts[{i}]", dt, settings.horizon)
    yield from _repeat_problems("dts", settings.dts)
    yield from _repeat_problems("grids", settings.grids or ())


def budget_problems(settings: AdviceSettings) -> Iterator[str]:
    """A budget that is too small for every grid."""
    if not settings.grids_to_try:
        yield f"budget: {settings.budget} states hold none of the grids; raise it, or set grids"


def size_problems(settings: ModelSettings) -> Iterator[str]:
    """What is too large to hold."""
    needed, there = expected_memory(settings) / 1e9, machine_memory() / 1e9
    if needed > there and settings.sampling is not None:
        yield (
            f"sampled.most: {settings.sampling.most} paths of a task, {settings.sampling.substeps} "
            f"substeps and these hypotheses take about {needed:.3g} GB, and this machine has "
            f"{there:.3g}; lower sampled.most, sampled.substeps or hypotheses, or raise dt"
        )
    elif needed > there:
        key = f"grid.shape: {list(settings.grid.shape)}"
        if settings.grid.refined:
            key = f"grid.refined: {settings.grid.refined} cells"
        yield (
            f"{key} with {list(settings.action_counts)} actions, "
            f"{settings.transition.samples} samples and these hypotheses takes about {needed:.3g} "
            f"GB, and this machine has {there:.3g}; use fewer cells, actions, samples or hypotheses"
        )


def trial_problems(settings: Settings) -> Iterator[str]:
    """More trials of the demonstrator than fit into memory."""
    there, asked = machine_memory(), settings.demonstrations
    trials = {"demonstrations.pairs": asked.pairs, "dynamics.tasks": settings.dynamics.tasks}
    for key, count in trials.items():
        if (needed := trial_memory(settings, count)) > there:
            yield (
                f"{key}: {count} trials, of {asked.restarts} first guesses each and in steps of "
                f"{asked.dt:g} s, take about {needed / 1e9:.3g} GB, and this machine has "
                f"{there / 1e9:.3g}; lower it or demonstrations.restarts, or raise "
                "demonstrations.dt"
            )


def resolution_problems(settings: Settings) -> Iterator[str]:
    """Kinds of cells that are too many to hold, or too few to begin with."""
    needed, there = resolution_memory(settings) / 1e9, machine_memory() / 1e9
    if needed > there:
        asked = settings.resolution
        yield (
            f"resolution.counts: {list(asked.counts)}, resolution.varying: "
            f"{list(asked.varying or asked.counts)} and resolution.finest: {asked.finest} with "
            f"{list(settings.action_counts)} actions take about {needed:.3g} GB, and this machine "
            f"has {there:.3g}; compare fewer cells, or use fewer actions"
        )


def refined_problems(settings: ModelSettings | AdviceSettings) -> Iterator[str]:
    """Cells of each task's own that no refinement leads to."""
    refined, first = settings.grid.refined, math.prod(settings.grid.shape)
    if not refined:
        return
    if isinstance(settings, ModelSettings) and settings.sampling is not None:
        yield (
            f"grid.refined: {refined}, but model=sampled has no cells; set it to 0, or take "
            "model=tabular"
        )
    if refined < first:
        yield (
            f"grid.refined: {refined} is less than the {first} cells of grid.shape, with which "
            "refinement begins; raise it, or lower grid.shape"
        )
    if any(settings.grid.offset or ()):
        yield (
            f"grid.offset: {list(settings.grid.offset or ())}, but refined cells begin at the "
            "bounds of the space; use null"
        )


def soft_problems(settings: RecordedSettings) -> Iterator[str]:
    """Weights need every single move, which a large model does not keep."""
    moves = settings.transition.samples ** len(settings.grid.shape)
    moves *= math.prod(settings.grid.shape) * math.prod(settings.action_counts)
    if settings.soft and not moves_are_kept(1, moves):
        yield (
            f"soft: {settings.soft}, but a weight needs every single move, and {moves} are more "
            f"than the {MOST_KEPT} that are kept; use fewer cells, actions or samples, or soft=0"
        )


def point_cell_problems(settings: Settings) -> Iterator[str]:
    """What a point asks of cells that all tasks share, where there are none."""
    asked = {
        "next_task.repetitions": (settings.next_task.repetitions, 0),
        "baselines.paths": (settings.baselines.paths, 0),
        "calibration.sets": (settings.calibration.sets, 0),
        "soft.weights": (list(settings.soft.weights), []),
        "dynamics.tasks": (settings.dynamics.tasks, 0),
    }
    yield from _cell_problems(settings, asked)


def recorded_cell_problems(settings: RecordedSettings) -> Iterator[str]:
    """What is asked of such cells beside recorded demonstrations."""
    asked = {
        "soft": (settings.soft, 0),
        "estimate_temperature": (settings.estimate_temperature, False),
    }
    yield from _cell_problems(settings, asked)


def _cell_problems(settings: ModelSettings, asked: Mapping[str, tuple[Any, Any]]) -> Iterator[str]:
    """What needs cells that all tasks share, by its key: its value, and the one that asks nothing.

    Also a budget of samples that is smaller than what is drawn at once.
    """
    sampling, refined = settings.sampling, settings.grid.refined
    if sampling is None and not refined:
        return
    words, way = "needs cells, and model=sampled has none", "take model=tabular"
    if sampling is None:
        words, way = "needs cells that all tasks share, and has none", "set grid.refined to 0"
    else:
        asked = {
            "inference.exact_ends": (settings.inference.exact_ends, True),
            "transition.samples": (settings.transition.samples, 1),
            **asked,
        }
    asked = {
        "inference.shapes.count": (settings.inference.shapes.count, 0),
        "hypotheses.controls.ranges": (list(settings.hypotheses.controls.ranges), []),
        "hypotheses.controls.predicates": (list(settings.hypotheses.controls.predicates), []),
        "hypotheses.controls.shares": (list(settings.hypotheses.controls.shares), []),
        **asked,
    }
    for key, (value, nothing) in asked.items():
        if value != nothing:
            yield (f"{key}: {_word(value)} {words}; set it to {_word(nothing)}, or {way}")
    if sampling is None:
        return
    bounds = settings.model.space.bounds
    largest = float(max(abs(bounds.lower).max(), abs(bounds.upper).max()))
    if largest - sampling.tolerance == largest:
        yield (
            f"sampled.tolerance: {sampling.tolerance} is lost in the rounding of states as large "
            f"as {largest:g}; raise it"
        )
    if sampling.most < sampling.samples:
        yield (
            f"sampled.most: {sampling.most} is less than the {sampling.samples} of "
            "sampled.samples; raise it, or lower samples"
        )


def _word(value: Any) -> str:
    """A value as YAML spells it."""
    return str(value).lower() if isinstance(value, bool) else str(value)


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
