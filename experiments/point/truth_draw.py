"""Random truths: hypotheses that optimal paths enter where nothing is forbidden."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np

import mlci.demonstrator
from experiments.config.settings import Settings
from experiments.point.dynamics_tables import unconstrained_paths
from experiments.point.forecasts import free_demonstrations
from experiments.point.no_answer import NoAnswer
from experiments.point.stages import region_inputs, shape_modules, system_module
from experiments.point.streams import Purpose, stream
from experiments.tracking.store import Store

_TASKS, _OFTEN = 60, 10  # of a seed, and those of them that are to cross its truth
_LEAST = 0.1  # share of the tasks that a truth must touch: else hardly a demonstration tells of it


def drawn_truths(settings: Settings, store: Store, count: int, seed: int = 0) -> list[int]:
    """Numbers of hypotheses, in order, drawn at random from the tasks' crossing region.

    That is all hypotheses which the optimal paths of at least a tenth of the tasks enter, of the
    `dynamics.tasks` that are drawn where nothing is forbidden.

    Args:
        settings: a point with the system, its tasks and hypotheses; its truth plays no part.
        store: where the tasks' optimal paths are kept.
        count: how many are drawn, at most all.
        seed: of the draw.
    """
    paths = unconstrained_paths(settings, store)
    entered = np.array([settings.candidates.violated_by(path.states) for path in paths])
    crossed = np.flatnonzero(entered.mean(axis=0) >= _LEAST)
    drawn = np.random.default_rng(seed).choice(crossed, min(count, len(crossed)), replace=False)
    return sorted(drawn.tolist())


def with_truth(settings: Settings, store: Store) -> Settings:
    """A point whose truth is to be drawn, with the hypothesis that is; any other as it is.

    Drawn at random of all hypotheses that at least 10 of the first 60 tasks of the point's seed
    cross where nothing is forbidden, between ends outside of them; where none is crossed so often,
    of those that are crossed most.

    Args:
        settings: the point.
        store: where it is kept what tasks cross.

    Raises:
        NoAnswer: no task crosses any hypothesis.
    """
    if not settings.truth.is_drawn:
        return settings

    def compute() -> dict[str, np.ndarray]:
        return {"crossed": _crossed(settings)}

    modules = [mlci.demonstrator, system_module(settings.model), sys.modules[__name__]]
    modules += shape_modules(settings, settings.candidates)
    crossed = store.get("truth_draw", draw_inputs(settings), modules, compute)["crossed"]
    most = int(np.max(crossed))
    if most == 0:
        raise NoAnswer(
            f"none of {_TASKS} tasks crosses a hypothesis between ends outside of it, so that no "
            "truth can be drawn: widen tasks, or narrow hypotheses"
        )
    often = np.flatnonzero(crossed >= min(_OFTEN, most))
    cell = int(stream(settings.seed, Purpose.TRUTH, 0).choice(often))
    return replace(settings, truth=replace(settings.truth, cell=cell))


def draw_inputs(settings: Settings) -> tuple[Any, ...]:
    """All that decides which hypotheses the tasks of a seed cross, beside code."""
    return (
        settings.system,
        region_inputs(settings, settings.candidates),
        replace(settings.demonstrations, pairs=1, keep=1, rule_breaking=0.0),
        replace(settings.tasks, crossing=False),
        settings.horizon,
        settings.seed,
    )


def _crossed(settings: Settings) -> np.ndarray:
    """(C,) how many of a seed's tasks cross each hypothesis between ends outside of it."""
    done = free_demonstrations(settings, _TASKS, settings.seed)
    regions = settings.candidates
    if not done:
        return np.zeros(len(regions), dtype=int)
    entered = np.array([regions.violated_by(each.states) for each in done])
    by_ends = np.array([regions.violated_by(each.states[[0, -1]][:, None]) for each in done])
    return np.asarray(np.sum(entered & ~by_ends.any(axis=1), axis=0))
