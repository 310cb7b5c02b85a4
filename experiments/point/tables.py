"""Third step of a point: its tables, and how they are written."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.area_shapes import area_table
from experiments.point.area_tables import area_tables
from experiments.point.baseline_tables import baseline_table
from experiments.point.belief_counts import belief_counts
from experiments.point.controls import control_tables
from experiments.point.evidence_kinds import evidence_table
from experiments.point.forecasts import forecast_table
from experiments.point.inference import PointInference
from experiments.point.joint import joint_tables
from experiments.point.measures import Measures
from experiments.point.model_tables import model_tables
from experiments.point.next_task_tables import next_task_table
from experiments.point.ranking_tables import rank_table, ranking_table
from experiments.point.resolution_tables import resolution_table
from experiments.point.sets import set_tables
from experiments.point.soft_tables import soft_table
from experiments.point.streams import Purpose, stream
from experiments.point.trajectory_tables import (
    probability_table,
    trajectory_tables,
    trial_that_shows_the_constraint,
)
from experiments.point.truth_tables import TRUTH_TABLES, truth_tables
from experiments.tracking.files import csv_bytes
from experiments.tracking.tables import rounded
from mlci.diagnosis import Diagnosis
from mlci.inference import Inference
from mlci.misfit import Misfit
from mlci.spaces import Floats
from mlci.systems import System

PAPER_SIZE = 9  # demonstrations after which the paper looks at the rank
FIRST = 5  # demonstrations of the paper's Fig. 7


def point_tables(
    settings: Settings, point: PointInference, measures: Measures, compared: Misfit
) -> dict[str, pd.DataFrame]:
    """The tables of a point, by name.

    Args:
        settings: the point.
        point: what the demonstrations say.
        measures: what the tabular agent does under the truth.
        compared: how the demonstrations compare with its own trajectories.

    Returns:
        `trials`, a row a demonstration; `ranks`, a row a subset of demonstrations; `hypotheses`, a
        row a hypothesis, ranked with all of them, and `first`, with the first FIRST of them;
        `summary`, one row; `sampled`, `violations`, `moves` and `probabilities`, of single
        trajectories; and the TRUTH_TABLES `attempts`, a row a start and goal pair, `paths`,
        `dimensions` of the state, and `regions` of the truth. If asked for, `sets` and
        `set_marginals`; `calibration`, and `evidence` and `forecasts` where these are calibrated;
        `baselines`, `next_task`, `soft`, `controls` and `control_ranks`, `resolution`, `area`,
        `areas` and `area_map`, and those of `model_tables`.
    """
    inference = point.inference
    covered = inference.hypotheses.inside(settings.constraint)
    overlapping = inference.hypotheses.overlaps(settings.constraint)
    example = trial_that_shows_the_constraint(measures.feasible, inference.phi, covered)
    example_number = int(point.numbers[example]) if measures.feasible.any() else None
    violated = dict(zip(point.numbers.tolist(), inference.violated, strict=True))
    ranks = rank_table(settings, inference, stream(settings.seed, Purpose.SUBSETS, 0))
    tables = {
        "trials": _trial_table(point, measures, covered),
        "ranks": ranks,
        **{
            name: ranking_table(part).assign(covered_by_truth=covered, overlaps_truth=overlapping)
            for name, part in (("hypotheses", inference), ("first", inference.of(slice(FIRST))))
        },
        **trajectory_tables(
            point.model, point.hypotheses, measures.trajectories, violated, example_number
        ),
        "probabilities": probability_table(
            example_number, inference.phi[example], measures.phi[example]
        ),
        **truth_tables(settings, point.trials, point.numbers),
        "summary": _summary_table(settings, point, measures, ranks),
    }
    if settings.misfit:
        # About one in 50 of the model's own trajectories is.
        tables["trials"]["rare"] = np.where(inference.reachable, compared.is_rare, np.nan)
    if point.beliefs.sets is not None:
        tables |= set_tables(point.beliefs.sets)
    if settings.calibration.sets:
        tables["calibration"] = belief_counts(settings, point)
        if point.calibration is not None and settings.inference.exact_ends:
            tables["evidence"] = evidence_table(settings, point, point.calibration)
            tables["forecasts"] = forecast_table(point.calibration)
    if settings.models.trials:
        tables |= model_tables(settings, point)
    if settings.baselines.paths:
        tables["baselines"] = baseline_table(settings, point)
    if point.beliefs.area is not None:
        tables["area"] = area_table(point.beliefs.area)
    if settings.areas.subsets:
        tables |= area_tables(settings, point)
    if settings.next_task.repetitions:
        tables["next_task"] = next_task_table(settings, point)
    if point.beliefs.controls is not None:
        rng = stream(settings.seed, Purpose.CONTROLS, 0)
        tables |= control_tables(settings, point.beliefs.controls, rng)
    if point.beliefs.joint is not None:
        inside = inference.hypotheses.inside(settings.constraint)
        rng = stream(settings.seed, Purpose.CONTROLS, 1)
        tables |= joint_tables(settings, point.beliefs.joint, inside, rng)
    if settings.soft.weights:
        tables["soft"] = soft_table(settings, point)
    if settings.resolution.counts:
        tables["resolution"] = resolution_table(settings, point)
    return tables


def opening_columns(name: str, settings: Settings) -> dict[str, str | int | float]:
    """The values that open every row of a point's table."""
    columns = settings.columns
    return {column: columns[column] for column in TRUTH_TABLES.get(name, columns)}


def table_bytes(name: str, frame: pd.DataFrame, settings: Settings) -> bytes:
    """A point's table as CSV, every row opened by the point's own values, which stay exact."""
    opening = opening_columns(name, settings)
    rows = rounded(frame.drop(columns=[column for column in frame.columns if column in opening]))
    for place, (column, value) in enumerate(opening.items()):
        rows.insert(place, column, value)
    return csv_bytes(rows)


def _trial_table(point: PointInference, measures: Measures, covered: np.ndarray) -> pd.DataFrame:
    """A row a demonstration: what the tabular agent makes of its task."""
    phi = point.inference.phi[:, covered]
    return pd.DataFrame(
        {
            "trial": point.numbers,
            "rule_breaking": point.trials.rule_breaking[point.numbers],
            "reachable": point.inference.reachable,
            "feasible": measures.feasible,
            "final_state_error": measures.final_state_error,
            "violation_distance": measures.violation_distance,
            "violation_floor": measures.violation_floor,
            "violation_distance_pooled": measures.violation_share,
            "truth_probability": np.max(phi, axis=1) if covered.any() else np.nan,
        }
    )


def _summary_table(
    settings: Settings, point: PointInference, measures: Measures, ranks: pd.DataFrame
) -> pd.DataFrame:
    """One row: counts of pairs by outcome, means of the measures, the diagnosis."""
    feasible, diagnosis, top = measures.feasible, point.diagnosis, settings.ranks.top
    after = ranks[ranks["demonstrations"] == PAPER_SIZE]
    row = {
        "pairs": len(point.trials.outcome),
        **point.trials.counts(),
        "demonstrations": len(point.numbers),
        "reachable": int(np.sum(point.inference.reachable)),
        "feasible": int(np.sum(feasible)),
        "final_state_error": _mean(measures.final_state_error[feasible]),
        "violation_distance": _mean(measures.violation_distance[feasible]),
        "violation_floor": _mean(measures.violation_floor[feasible]),
        "violation_distance_pooled": _mean(measures.violation_share[feasible]),
        f"rank_after_{PAPER_SIZE}": after["rank"].median(),
        f"share_top_{top}_after_{PAPER_SIZE}": after[f"share_top_{top}"].mean(),
        **_rule_breaking(point.inference),
        **_diagnosis_columns(settings.model, diagnosis),
    }
    return pd.DataFrame([row])


def _diagnosis_columns(system: System, diagnosis: Diagnosis | None) -> dict[str, float]:
    """How cells move; NaN where there are none."""
    names, controls = system.space.names, range(1, system.control_box.dimension + 1)
    columns = ["stay", "leave", "cells_crossed", *(f"frozen_{name}" for name in names)]
    noises = ["noise", "free_noise"]
    columns += [f"{noise}_{control}" for noise in noises for control in controls]
    if diagnosis is None:
        return dict.fromkeys(columns, np.nan)
    values = [diagnosis.stay, diagnosis.leave, diagnosis.cells_crossed, *diagnosis.frozen]
    return dict(zip(columns, [*values, *diagnosis.noise, *diagnosis.free_noise], strict=True))


def _rule_breaking(inference: Inference) -> dict[str, float]:
    """The rate of rule breaking, with its interval where it is estimated."""
    estimate = inference.rule_breaking
    return {
        "rule_breaking_rate": inference.rates.rule_breaking,
        "rule_breaking_lower": np.nan if estimate is None else estimate.lower,
        "rule_breaking_upper": np.nan if estimate is None else estimate.upper,
    }


def _mean(values: Floats) -> float:
    """The mean, NaN of nothing."""
    return float(np.mean(values)) if len(values) else np.nan
