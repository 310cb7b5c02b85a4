"""How often the model's forecasts come true, kept in the store.

The demonstrator that inference knows of, whatever real ones are like, does tasks from the study's
box without a constraint. So all truths, seeds and realities of a study share what it shows.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any, TypeVar

import numpy as np
import pandas as pd

import mlci.calibration
import mlci.demonstrator
from experiments.config.settings import ModelSettings, RecordedSettings, Settings
from experiments.point.stages import inference_model, model_inputs, shape_modules, system_module
from experiments.point.trials import nominal_skill
from experiments.progress import begin
from experiments.tracking.sources import source_hash
from experiments.tracking.store import Store
from experiments.tracking.trees import canonical_json, plain
from mlci.calibration import Calibration, calibrate, calibrate_on
from mlci.demonstrations import Demonstration
from mlci.demonstrator import Outcome, demonstrate, sample_trials
from mlci.forecast_scores import BIN_COLUMNS, ForecastScores, Score
from mlci.forecasts import ForecastCurve, ForecastMap
from mlci.models import Model

TRIALS = 200
SEED = 1 << 32  # one more than a study can have: none of its tasks is among these
_JUDGED = ("before", "after")
T = TypeVar("T")


def forecast_inputs(settings: Settings) -> tuple[Any, ...]:
    """All that the calibration depends on, beside code."""
    return (
        model_inputs(settings, settings.candidates),
        replace(settings.demonstrations, pairs=TRIALS, keep=TRIALS, rule_breaking=0.0),
        replace(settings.tasks, crossing=False),
        settings.horizon,
        settings.sampling,
        settings.inference.exact_ends,
    )


def forecast_calibration(settings: Settings, store: Store) -> Calibration:
    """The map of forecasts and their scores, from the store or computed."""

    def compute() -> dict[str, np.ndarray]:
        model = inference_model(settings, store)
        calibration = calibrate_on(
            model,
            free_demonstrations(settings),
            tried=TRIALS,
            hypotheses=model.regions.mask(settings.candidates.names),
            exact_ends=settings.inference.exact_ends,
        )
        return _arrays(calibration)

    modules = _modules(settings)
    return _calibration(store.get("forecasts", forecast_inputs(settings), modules, compute))


def free_demonstrations(
    settings: Settings, trials: int = TRIALS, seed: int = SEED
) -> list[Demonstration]:
    """What the demonstrator that inference knows of does of some tasks without a constraint.

    Args:
        settings: the point.
        trials: number of tasks, some of which may fail.
        seed: of the tasks: by default those of no study.
    """
    system, demonstrator = settings.model, settings.demonstrations
    tasks = sample_trials(
        system,
        None,
        settings.tasks.start_box(system.space),
        trials=trials,
        seed=seed,
        horizon=settings.horizon,
        dt=demonstrator.dt,
        goal_offsets=settings.tasks.goal_offsets,
        restarts=demonstrator.restarts,
        hold=demonstrator.hold,
    )
    attempts = demonstrate(system, tasks, None, None, **nominal_skill(settings))
    return [each.demonstration for each in attempts if each.outcome is Outcome.KEPT]


def _modules(settings: ModelSettings) -> list[ModuleType]:
    """The modules that `forecast_calibration` depends on."""
    here = sys.modules[__name__]
    modules = [mlci.calibration, mlci.demonstrator, system_module(settings.model), here]
    return modules + shape_modules(settings, settings.candidates)


def exported_calibration(settings: RecordedSettings, exported: Store) -> Calibration | None:
    """The calibration that a point's demonstrations were exported with, if it fits the settings.

    It fits if the tabular model, the hypotheses and the kind of ends are the point's, if every
    touch counts as crossing, as it does in points, and if the source is that of now.
    """
    if not settings.crossing.crossing().is_any:
        return None
    return exported_stage(settings, exported, "forecasts", _modules(settings), _calibration)


def exported_stage(
    settings: RecordedSettings,
    exported: Store,
    stage: str,
    modules: Sequence[ModuleType],
    read: Callable[[Mapping[str, np.ndarray]], T],
    *more: Any,
) -> T | None:
    """What a point was exported with, if it fits: see `exported_calibration`.

    Args:
        settings: of the inference from the exported demonstrations.
        exported: the store that lies beside them.
        stage: what is asked for.
        modules: those that the point computed it with.
        read: makes it of the stored arrays.
        more: what it depends on beside `forecast_inputs`.
    """
    model, ends = model_inputs(settings, settings.candidates), settings.inference.exact_ends
    inputs = canonical_json(plain([model, settings.sampling, ends, *more]))
    source = source_hash([module.__name__ for module in modules])
    for made_from, arrays in exported.entries(stage):
        try:
            depends = made_from["depends"]
            same = canonical_json([depends[0], *depends[-2 - len(more) :]]) == inputs
            if same and made_from["source"] == source:
                return read(arrays)
        except (LookupError, TypeError, ValueError):  # somebody else made it
            continue
    return None


def recorded_calibration(
    settings: RecordedSettings,
    model: Model,
    demonstrations: Sequence[Demonstration],
    store: Store,
) -> Calibration:
    """The map for recorded demonstrations, by tasks like theirs; from the store or computed."""
    tasks = [demonstration.task for demonstration in demonstrations]
    exact_ends, crossing = settings.inference.exact_ends, settings.crossing.crossing()
    numbers = [[*task.start, *task.goal.lower, *task.goal.upper, task.horizon] for task in tasks]
    depends = (
        model_inputs(settings, settings.candidates),
        [[repr(float(number)) for number in row] for row in numbers],  # infinite sides are no JSON
        settings.sampling,
        exact_ends,
        dataclasses.astuple(crossing),
    )

    def compute() -> dict[str, np.ndarray]:
        begin(f"simulating {TRIALS} tasks like these, to calibrate the evidence")
        return _arrays(
            calibrate(model, tasks, trials=TRIALS, exact_ends=exact_ends, crossing=crossing)
        )

    modules = [mlci.calibration, system_module(settings.model), sys.modules[__name__]]
    return _calibration(store.get("recorded_forecasts", depends, modules, compute))


def forecast_table(calibration: Calibration) -> pd.DataFrame:
    """A row a bin of forecasts for tasks that the map was not fitted on.

    `map` is 0 for Phi itself and 1 for calibrated forecasts; beside the columns of
    `ForecastScores.bins` there are the scores of all bins together.
    """
    tables = [pd.DataFrame(columns=["map", *BIN_COLUMNS, *_SCORES])]
    for number, scores in enumerate((calibration.before, calibration.after)):
        if scores is not None:
            of_all = dict(zip(_SCORES, _score_row(scores), strict=True))
            tables.append(scores.bins.assign(**of_all)[[*BIN_COLUMNS, *_SCORES]])
            tables[-1].insert(0, "map", number)
    return pd.concat(tables[1:] or tables, ignore_index=True)


_SCORES = (
    *(f"log_score{end}" for end in ("", "_low", "_high")),
    *(f"brier{end}" for end in ("", "_low", "_high")),
    "off_by",
)


def _score_row(scores: ForecastScores) -> list[float]:
    """The scores of all bins together."""
    log_score, brier = (dataclasses.astuple(each) for each in (scores.log_score, scores.brier))
    return [*log_score, *brier, scores.off_by]


def _arrays(calibration: Calibration) -> dict[str, np.ndarray]:
    """A calibration as arrays, for the store."""
    arrays = {
        "tasks": np.array([calibration.tried, calibration.used]),
        "excess": calibration.excess,
    }
    if calibration.out_of_reach is not None:
        arrays["out_of_reach"] = np.array(calibration.out_of_reach)
    arrays |= map_arrays(calibration.map)
    for name in _JUDGED:
        scores = getattr(calibration, name)
        if scores is not None:
            arrays[f"{name}_bins"] = scores.bins[list(BIN_COLUMNS)].to_numpy(dtype=float)
            arrays[f"{name}_scores"] = np.array(_score_row(scores))
    return arrays


def _calibration(arrays: Mapping[str, np.ndarray]) -> Calibration:
    """The calibration that some arrays hold."""
    out_of_reach = arrays.get("out_of_reach")
    before, after = (_scores(arrays, name) for name in _JUDGED)
    return Calibration(
        tried=int(arrays["tasks"][0]),
        used=int(arrays["tasks"][1]),
        map=stored_map(arrays),
        before=before,
        after=after,
        out_of_reach=None if out_of_reach is None else float(out_of_reach),
        excess=arrays["excess"],
    )


def map_arrays(forecasts: ForecastMap | None) -> dict[str, np.ndarray]:
    """A map as arrays, for the store."""
    if forecasts is None:
        return {}
    rows = [[*curve.sizes, *dataclasses.astuple(curve)[1:]] for curve in forecasts.curves]
    return {"curves": np.array(rows)}


def stored_map(arrays: Mapping[str, np.ndarray]) -> ForecastMap | None:
    """The map that some arrays hold, if they do."""
    curves = [
        ForecastCurve((row[0], row[1]), int(row[2]), int(row[3]), *row[4:])
        for row in arrays.get("curves", np.empty((0, 8))).tolist()
    ]
    return ForecastMap(tuple(curves)) if curves else None


def _scores(arrays: Mapping[str, np.ndarray], name: str) -> ForecastScores | None:
    """The scores of some name that some arrays hold, if they do."""
    if f"{name}_bins" not in arrays:
        return None
    row = arrays[f"{name}_scores"].tolist()
    bins = pd.DataFrame(arrays[f"{name}_bins"], columns=list(BIN_COLUMNS)).astype({"count": int})
    return ForecastScores(Score(*row[:3]), Score(*row[3:6]), row[6], bins)
