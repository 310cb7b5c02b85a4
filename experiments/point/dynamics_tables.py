"""What was known before anybody demonstrated, beside what came of inference."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

import mlci.demonstrator
from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.measures import Measures
from experiments.point.stages import model_inputs, shape_modules, system_module
from experiments.point.trials import nominal_skill
from experiments.tracking.store import Store
from mlci.demonstrations import Demonstration, Task, even_times
from mlci.demonstrator import Outcome, demonstrate, sample_trials
from mlci.outlook.outlook import FEATURES, outlook
from mlci.spaces import Box, Floats, Ints

_SEED = (1 << 32) + 1  # more than a study can have, and not that of `forecasts`


def dynamics_table(
    settings: Settings, point: PointInference, measures: Measures, ranks: pd.DataFrame, store: Store
) -> pd.DataFrame:
    """One row: a point's outlook and its success.

    Args:
        settings: the point.
        point: what the demonstrations say.
        measures: what the tabular agent does under the truth.
        ranks: the point's table of that name.
        store: where the tasks' optimal paths are kept.

    Returns:
        `system`, its class; `tasks` that the outlook rests on; the numbers of
        `mlci.outlook.outlook.FEATURES` of that hypothesis inside the truth which is crossed most,
        missing if there is none; `demonstrations` that were seen, and over random subsets of that
        size `top`, how often the truth is among the first `ranks.top`, `first`, how often it is
        first, `log_rank`, the mean logarithm of its rank, `claim`, the mean posterior probability
        of the first; `violation_distance` [regions] of a demonstration; `out_of_reach`, the share
        of goals that the tabular agent cannot reach.
    """
    paths = unconstrained_paths(settings, store)
    covered = np.flatnonzero(point.inference.hypotheses.inside(settings.constraint))
    features = np.full(len(FEATURES), np.nan)
    if len(covered) and paths:
        features = _features(settings, point, covered, paths, store)
    seen = ranks[ranks["demonstrations"] == ranks["demonstrations"].max()]
    row = {
        "system": type(settings.model).__name__,
        "tasks": len(paths),
        **dict(zip(FEATURES, features, strict=True)),
        "demonstrations": int(seen["demonstrations"].iloc[0]),
        "top": seen[f"share_top_{settings.ranks.top}"].mean(),
        "first": seen["top_1_inside"].mean(),
        "log_rank": np.log(seen["rank"]).mean(),
        "claim": seen["claim"].mean(),
        "violation_distance": pd.Series(measures.violation_distance).mean(),
        "out_of_reach": float(np.mean(~point.inference.reachable)),
    }
    return pd.DataFrame([row])


def _features(
    settings: Settings,
    point: PointInference,
    covered: Ints,
    paths: list[Demonstration],
    store: Store,
) -> Floats:
    """(F,) numbers of that covered hypothesis which is crossed most; all seeds share them."""

    def compute() -> dict[str, np.ndarray]:
        known, ranks = outlook(point.tabular, paths, point.hypotheses), settings.ranks
        truth = covered[np.argmax(known.crossed[covered])]
        return {"features": known.features([truth], ranks.demonstrations, ranks.top)[0]}

    regions = settings.candidates
    inputs = [
        model_inputs(settings, regions),
        path_inputs(settings),
        covered.tolist(),
        settings.ranks.demonstrations,
        settings.ranks.top,
    ]
    modules = [mlci.demonstrator, system_module(settings.model), sys.modules[__name__]]
    modules += shape_modules(settings, regions)
    features: Floats = store.get("features", inputs, modules, compute)["features"]
    return features


def path_inputs(settings: Settings) -> tuple[Any, ...]:
    """All that the tasks' optimal paths depend on, beside code."""
    return (
        settings.system,
        settings.dynamics,
        replace(settings.demonstrations, pairs=1, keep=1, rule_breaking=0.0),
        replace(settings.tasks, crossing=False),
        settings.horizon,
    )


def unconstrained_paths(settings: Settings, store: Store) -> list[Demonstration]:
    """Optimal paths of tasks where nothing is forbidden, those that the demonstrator can do.

    All truths, seeds, grids and time steps of a system share them.
    """
    system, demonstrator, dt = settings.model, settings.demonstrations, settings.demonstrations.dt

    def compute() -> dict[str, np.ndarray]:
        trials = sample_trials(
            system,
            None,
            settings.tasks.start_box(system.space),
            trials=settings.dynamics.tasks,
            seed=_SEED,
            horizon=settings.horizon,
            dt=dt,
            goal_offsets=settings.tasks.goal_offsets,
            restarts=demonstrator.restarts,
            hold=demonstrator.hold,
        )
        attempts = demonstrate(system, trials, None, None, **nominal_skill(settings))
        kept = [each.demonstration for each in attempts if each.outcome is Outcome.KEPT]
        n, m = system.space.dimension, system.control_box.dimension
        steps = trials[0].guesses.shape[1]
        return {
            "goals": np.array([[p.task.goal.lower, p.task.goal.upper] for p in kept])
            if kept
            else np.zeros((0, 2, n)),
            "states": np.array([p.states for p in kept]) if kept else np.zeros((0, steps + 1, n)),
            "controls": np.array([p.controls for p in kept]) if kept else np.zeros((0, steps, m)),
        }

    inputs = path_inputs(settings)
    modules = [mlci.demonstrator, system_module(system), sys.modules[__name__]]
    stored = store.get("unconstrained", inputs, modules, compute)
    return [
        Demonstration(
            Task(states[0], Box(*goal), settings.horizon),
            states,
            controls,
            even_times(len(states), dt),
            f"task_{number:03d}",
        )
        for number, (goal, states, controls) in enumerate(
            zip(stored["goals"], stored["states"], stored["controls"], strict=True)
        )
    ]
