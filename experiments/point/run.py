"""One point of a study, from settings to tables: the walk of the paper's sections III to V."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from experiments.belief_lines import belief_lines
from experiments.config.settings import Settings
from experiments.console import (
    answer_lines,
    diagnosis_lines,
    measure_lines,
    trial_lines,
)
from experiments.point.dynamics_tables import dynamics_table
from experiments.point.inference import infer_point, point_answer
from experiments.point.measures import measure_point
from experiments.point.stages import cost_lines
from experiments.point.tables import point_tables
from experiments.point.transfer_tables import transfer_tables
from experiments.point.truth_draw import with_truth
from experiments.progress import begin
from experiments.terminal import entry
from experiments.tracking.store import Store


def run_point(
    settings: Settings, store: Store, log: Callable[[str], None]
) -> dict[str, pd.DataFrame]:
    """Run one point: infer, measure, tables.

    Args:
        settings: the point.
        store: where shared stages are kept.
        log: called with each line for a reader.

    Returns:
        Tables by name, see `experiments.point.tables.point_tables`; if asked for,
        those of `transfer_tables` and `dynamics_table`.
    """
    settings = with_truth(settings, store)
    for line in cost_lines(settings):
        log(line)
    begin("ranking hypotheses")
    inferred = infer_point(settings, store)
    inference, space, top = inferred.inference, settings.model.space, settings.ranks.top
    result = point_answer(settings, inferred)
    covered = np.flatnonzero(inference.hypotheses.inside(settings.constraint)).tolist()
    begin("")
    for line in answer_lines(result, top, covered):
        log(line)
    for line in belief_lines(inferred.beliefs, top):
        log(line)
    if inferred.calibration is not None:
        for line in entry("calibration", inferred.calibration.summary()):
            log(line)
    for line in trial_lines(inferred.trials.counts()):
        log(line)
    if inferred.diagnosis is not None:
        tasks = len(inferred.numbers)
        for line in diagnosis_lines(inferred.diagnosis, space.names, inferred.unreachable, tasks):
            log(line)
    begin("measuring")
    measures = measure_point(settings, inferred)
    tables = point_tables(settings, inferred, measures, result.misfit)
    if settings.transfer.strengths:
        begin("with stronger and weaker controls")
        tables |= transfer_tables(settings, inferred, store)
    if settings.dynamics.tasks:
        begin("what was known before")
        tables["dynamics"] = dynamics_table(settings, inferred, measures, tables["ranks"], store)
    begin("")
    for line in measure_lines(tables["summary"].iloc[0], tables["ranks"], top):
        log(line)
    return tables
