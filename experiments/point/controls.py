"""What demonstrations say of controls, where a config asks: belief, tables and record."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd

import mlci.actuation.inference
import mlci.demonstrator
from experiments.config.settings import ModelSettings, RecordedSettings, Settings
from experiments.config.settings.controls import ranges_of
from experiments.point.forecasts import (
    TRIALS,
    exported_stage,
    forecast_inputs,
    free_demonstrations,
    map_arrays,
    stored_map,
)
from experiments.point.stages import system_module
from experiments.progress import begin
from experiments.tracking.store import Store
from mlci.actuation.hypotheses import JoinedHypotheses
from mlci.actuation.inference import ControlInference, calibrate_controls, infer_controls
from mlci.actuation.ranges import ControlRanges
from mlci.demonstrations import Demonstration
from mlci.evidence import posterior, rank_scores, total_gain
from mlci.forecasts import ForecastMap
from mlci.json_numbers import finite
from mlci.metrics import random_subsets, truth_ranks
from mlci.similar_tasks import similar_demonstrations
from mlci.spaces import Bools
from mlci.tabular import TabularModel

_STAGE = "control_forecasts"


def point_controls(
    settings: Settings,
    store: Store,
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
) -> ControlInference | None:
    """What a point's demonstrations say of controls; None where nothing is asked of these."""
    forecasts = None
    if settings.hypotheses.controls.is_asked and settings.inference.calibrate:
        modules = _modules(settings)
        depends = (*forecast_inputs(settings), settings.hypotheses.controls)

        def compute() -> dict[str, np.ndarray]:
            return map_arrays(_fitted(settings, model, free_demonstrations(settings)))

        stored = store.get(_STAGE, depends, modules, compute)
        forecasts = stored_map(stored)
    return _inferred(settings, model, demonstrations, forecasts)


def recorded_controls(
    settings: RecordedSettings,
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    exported: Store | None = None,
) -> ControlInference | None:
    """What recorded demonstrations say of controls; None where nothing is asked of these.

    Args:
        settings: what is asked.
        model: the tabular model.
        demonstrations: the N demonstrations.
        exported: what a point's calibration was exported to, with its demonstrations. If it fits,
            it is used; else tasks like the recorded ones are simulated.
    """
    forecasts = None
    if settings.hypotheses.controls.is_asked:
        begin("ranking ranges of controls")
        if settings.inference.calibrate and exported is not None:
            more = settings.hypotheses.controls
            modules = _modules(settings)
            forecasts = exported_stage(settings, exported, _STAGE, modules, stored_map, more)
        if settings.inference.calibrate and forecasts is None:
            rng = np.random.default_rng(0)
            unlimited = similar_demonstrations(model, demonstrations, TRIALS, rng)
            forecasts = _fitted(settings, model, unlimited)
    return _inferred(settings, model, demonstrations, forecasts)


def control_tables(
    settings: Settings, controls: ControlInference, rng: np.random.Generator
) -> dict[str, pd.DataFrame]:
    """`controls`, a row a range, the most likely first; `control_ranks`, a row a random subset of
    the demonstrations and kind of evidence.

    Returns:
        `controls` has the columns of `ControlInference.to_frame`; `is_truth`, whether a range is
        all of what is forbidden; and `in_truth`, whether it is part of that. `control_ranks` has
        `demonstrations`, their number; `subset`; `calibrated`, 1 if forecasts are; `first`, the
        range that comes first; `rank` and `posterior` of the truth, and whether it comes first
        alone (`true_first`), NaN where no hypothesis is the truth; `none`, the posterior
        probability that nothing is forbidden; whether the most probable answer is a range that is
        no part of the truth (`wrong`), and one above 0.5 (`wrong_sure`).
    """
    is_truth, in_truth = against_truth(settings)
    known = is_truth.any()
    names = np.array(controls.hypotheses.names, dtype=object)
    rates = settings.inference.rates(calibrated=False)
    kinds = [(0, replace(controls, calibration=None, rates=rates))]
    if controls.calibration is not None:
        kinds.append((1, controls))
    ranks, rows = settings.ranks, []
    for subsets in random_subsets(len(controls.names), ranks.demonstrations, ranks.subsets, rng):
        for calibrated, kind in kinds:
            gains = total_gain(kind.evidence[subsets])
            each, none = posterior(gains, kind.prior_none)
            first, best = np.argmax(gains, axis=1), np.max(each, axis=1)
            rank = truth_ranks(rank_scores(gains, gains > -np.inf), is_truth)
            wrong = ~in_truth[first] & (best > none)
            part = {
                "demonstrations": subsets.shape[1],
                "subset": np.arange(len(subsets)),
                "calibrated": calibrated,
                "first": np.where(np.max(gains, axis=1) > -np.inf, names[first], ""),
                "rank": rank,
                "posterior": each[:, is_truth].sum(axis=1) if known else np.nan,
                "none": none,
                "true_first": (rank == 1).astype(int) if known else np.nan,
                "wrong": wrong.astype(int),
                "wrong_sure": (wrong & (best > 0.5)).astype(int),
            }
            rows.append(pd.DataFrame(part))
    order = controls.ranking.order
    frame = controls.to_frame().assign(is_truth=is_truth[order], in_truth=in_truth[order])
    return {"controls": frame, "control_ranks": pd.concat(rows, ignore_index=True)}


def against_truth(settings: Settings) -> tuple[Bools, Bools]:
    """(C,) which hypotheses are what is forbidden in truth, and which are a part of it; predicates
    are neither."""
    system, truth = settings.model, ranges_of(settings.truth.controls, settings.model)
    asked, box = settings.hypotheses.controls, system.control_box
    hypotheses = asked.all_ranges(system)
    low, high = np.maximum(hypotheses.lower, box.lower), np.minimum(hypotheses.upper, box.upper)
    from_, to = np.maximum(truth.lower, box.lower), np.minimum(truth.upper, box.upper)
    inside = np.all((low[:, None] >= from_) & (high[:, None] <= to), axis=-1)
    same = np.all((low[:, None] == from_) & (high[:, None] == to), axis=-1)
    no_range = np.zeros(len(asked.predicates), dtype=bool)
    return np.append(np.any(same, axis=1), no_range), np.append(np.any(inside, axis=1), no_range)


def control_record(controls: ControlInference) -> dict[str, Any]:
    """The belief for programs, fit for JSON; predicates have no ends."""
    calibration, hypotheses = controls.calibration, controls.hypotheses
    assert isinstance(hypotheses, JoinedHypotheses)
    ends = {name: {"lower": None, "upper": None} for name in hypotheses.names} | {
        name: {"lower": list(map(finite, low)), "upper": list(map(finite, high))}
        for part in hypotheses.parts
        if isinstance(part, ControlRanges)
        for name, low, high in zip(part.names, part.lower, part.upper, strict=True)
    }
    return {
        "none": controls.ranking.posterior_none,
        "largest_gain_of_one": None if calibration is None else calibration.largest_gain,
        "ranges": [
            {**row, **ends[row["name"]], "gain": finite(row["gain"])}
            for row in controls.to_frame().to_dict("records")
        ],
    }


def _modules(settings: ModelSettings) -> list[ModuleType]:
    """The modules that a map of forecasts of controls depends on."""
    here = sys.modules[__name__]
    predicates = [
        sys.modules[each.target.rpartition(".")[0]]
        for each in settings.hypotheses.controls.predicates
    ]
    system = system_module(settings.model)
    return [mlci.actuation.inference, mlci.demonstrator, system, here, *predicates]


def _fitted(
    settings: ModelSettings, model: TabularModel, unlimited: Sequence[Demonstration]
) -> ForecastMap | None:
    """The map of forecasts by demonstrators whom nothing limits."""
    controls, system = settings.hypotheses.controls, settings.model
    return calibrate_controls(
        model,
        unlimited,
        controls.hypotheses(system),
        tolerance=controls.reach(system),
        exact_ends=settings.inference.exact_ends,
        round_horizon=True,
    )


def _inferred(
    settings: ModelSettings,
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    forecasts: ForecastMap | None,
) -> ControlInference | None:
    """What demonstrations say of controls; None where nothing is asked of these."""
    if not settings.hypotheses.controls.is_asked:
        return None
    controls, system = settings.hypotheses.controls, settings.model
    return infer_controls(
        model,
        demonstrations,
        controls.hypotheses(system),
        tolerance=controls.reach(system),
        prior_none=settings.inference.prior,
        rates=settings.inference.rates(calibrated=forecasts is not None),
        calibration=forecasts,
        exact_ends=settings.inference.exact_ends,
        round_horizon=True,
    )
