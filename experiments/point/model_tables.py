"""How good a model is, asked alike of cells and of sampled paths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.forecasts import free_demonstrations
from experiments.point.inference import PointInference
from experiments.point.stages import formed_model
from experiments.progress import begin
from mlci.calibration import certain_by_ends
from mlci.forecast_scores import Score, score_forecasts
from mlci.preparation import PreparedInference, prepare
from mlci.rank_errors import rank_errors
from mlci.spaces import Floats

_ROUNDED = 1e-3  # forecasts nearer to 0 or 1 are scored as this


def model_tables(settings: Settings, point: PointInference) -> dict[str, pd.DataFrame]:
    """Tables of the model itself.

    Returns:
        `models`, one row: `tasks` that were done without a constraint, of which the model can do
        `possible` ones; scores of its forecasts for these, `brier` and `log_score`, each with
        `_low` and `_high`, and `off_by`; with all demonstrations the `rank` of the truth, which
        samples leave between `rank_lowest` and `rank_highest`, and how many of the first ranks are
        `settled`; of the samples `effective`, the median over tasks, and `doubted`, tasks whose
        samples are not to be believed. `halving`, if `models.steps` asks, a row a demonstration
        and time step: the mean square `change` of Phi to the next `shorter` one, and the part of it
        that is `noise` of samples.
    """
    tables = {"models": pd.DataFrame([{**_scores(settings, point), **_sampling(settings, point)}])}
    if settings.models.steps:
        tables["halving"] = halving_table(settings, point)
    return tables


def halving_table(settings: Settings, point: PointInference) -> pd.DataFrame:
    """How Phi changes from each time step to the next shorter one."""
    steps = sorted(settings.models.steps, reverse=True)
    done = point.demonstrations[: settings.models.tasks]
    prepared: list[PreparedInference] = []
    for step in steps:
        begin(f"Phi at a time step of {step:g} s")
        model = formed_model(replace(settings, dt=step), settings.candidates)
        tasks = [each.task for each in done]
        prepared.append(prepare(model, tasks, exact_ends=settings.inference.exact_ends))
    rows = []
    for step, shorter, long, short in zip(steps, steps[1:], prepared, prepared[1:], strict=False):
        change = np.mean(np.square(long.avoidance - short.avoidance), axis=1)
        noise = _noise(long) + _noise(short)
        for j in np.flatnonzero(long.reachable & short.reachable):
            row = {"step": step, "shorter": shorter, "trial": int(point.numbers[j])}
            rows.append({**row, "change": change[j], "noise": noise[j]})
    return pd.DataFrame(rows, columns=["step", "shorter", "trial", "change", "noise"])


def _noise(prepared: PreparedInference) -> Floats:
    """(N,) mean variance of alpha by its samples, without the allowance for what none shows."""
    sampling = prepared.sampling
    if sampling is None:
        return np.zeros(len(prepared.tasks))
    with np.errstate(divide="ignore"):
        allowance = np.square(1 / sampling.effective)[:, None]
    return np.asarray(np.mean(np.maximum(np.square(sampling.errors) - allowance, 0), axis=1))


def _scores(settings: Settings, point: PointInference) -> dict[str, float]:
    """How good its forecasts are of demonstrators whom nothing constrains."""
    begin("scoring forecasts")
    trials = min(settings.models.trials, settings.demonstrations.keep)
    done = free_demonstrations(settings, trials)
    regions = point.inference.hypotheses
    tasks = [each.task for each in done]
    prepared = prepare(
        point.model,
        tasks,
        hypotheses=point.hypotheses,
        exact_ends=settings.inference.exact_ends,
    )
    hits = np.array([regions.violated_by(each.states) for each in done])
    counts = ~(certain_by_ends(regions, tasks) | prepared.decided_by_cell)
    counts &= prepared.reachable[:, None]
    row: dict[str, float] = {"tasks": len(tasks), "possible": int(np.sum(prepared.reachable))}
    nothing = Score(np.nan, np.nan, np.nan)
    brier, log_score, off_by = nothing, nothing, np.nan
    if counts.any():
        alpha = np.clip(prepared.avoidance, _ROUNDED, 1 - _ROUNDED)
        scores = score_forecasts(alpha, hits, counts)
        brier, log_score, off_by = scores.brier, scores.log_score, scores.off_by
    for name, score in (("brier", brier), ("log_score", log_score)):
        row |= {name: score.mean, f"{name}_low": score.low, f"{name}_high": score.high}
    return {**row, "off_by": off_by}


def _sampling(settings: Settings, point: PointInference) -> dict[str, float]:
    """How surely the ranking is known, and how good samples are; NaN for what is not sampled."""
    inference, errors = point.inference, rank_errors(point.inference)
    covered = np.flatnonzero(inference.hypotheses.inside(settings.constraint))
    settled, sampling = errors.settled[inference.order], inference.sampling
    row = {"rank": np.nan, "rank_lowest": np.nan, "rank_highest": np.nan}
    if len(covered):
        best = covered[np.argmin(errors.rank[covered])]
        row = {
            "rank": float(errors.rank[best]),
            "rank_lowest": float(errors.lowest[best]),
            "rank_highest": float(errors.highest[best]),
        }
    return {
        **row,
        "settled": len(settled) if settled.all() else int(np.argmin(settled)),
        "effective": np.nan if sampling is None else float(np.median(sampling.effective)),
        "doubted": np.nan if sampling is None else sum(map(bool, sampling.complaints)),
    }
