"""One point of a study, from settings to tables: the walk of the paper's sections III to V."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from experiments.config.settings import Settings
from experiments.console import diagnosis_lines, measure_lines, ranking_lines, trial_line
from experiments.point.inference import infer_point
from experiments.point.measures import measure_point
from experiments.point.tables import point_tables
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
        Tables by name, see `experiments.point.tables.point_tables`.
    """
    inferred = infer_point(settings, store)
    space, top = settings.model.space, settings.ranks.top
    log(trial_line(inferred.trials.counts()))
    for line in diagnosis_lines(
        inferred.diagnosis, space.names, inferred.unreachable, len(inferred.numbers)
    ):
        log(line)
    measures = measure_point(settings, inferred)
    tables = point_tables(settings, inferred, measures)
    for line in ranking_lines(tables["hypotheses"], space, top):
        log(line)
    for line in measure_lines(tables["summary"].iloc[0], tables["ranks"], top):
        log(line)
    return tables
