"""Rank constraints from recorded demonstrations: python experiments/infer.py demonstrations=PATH"""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before all that takes time to import
    from experiments import app

    sys.exit(app.infer())

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import mlci.preparation
from experiments.app import DONE, FAILED, run_command
from experiments.config.paths import results_folder
from experiments.config.read import ConfigError, read_recorded_config, writable_results
from experiments.config.settings import ESTIMATE, RecordedSettings
from experiments.console import answer_lines, diagnosis_lines
from experiments.page.document import page
from experiments.point.forecasts import recorded_calibration
from experiments.point.ranking_tables import ranking_table
from experiments.point.truth_tables import dimension_table
from experiments.progress import begin, steps_shown
from experiments.terminal import entry
from experiments.tracking.environment import environment
from experiments.tracking.files import csv_bytes, digest, replace_file
from experiments.tracking.store import Store
from experiments.tracking.trees import canonical_json, plain
from mlci.answers import Answer, answer
from mlci.calibration import Calibration
from mlci.demonstrations import Demonstration
from mlci.diagnosis import diagnose
from mlci.inference import Inference
from mlci.maxent import ROUNDED_TIMES
from mlci.recordings.read import Readings, read_demonstrations
from mlci.recordings.recording import Remark
from mlci.recordings.times import refuse_long
from mlci.tabular import TabularModel, discretize
from mlci.temperature import estimate_temperature
from paper_figures import hypothesis_map
from paper_figures.style import save

ON_WRONG_MODELS = (
    'results/paper/REPORT.md, "Demonstrators who are not the nominal model", for how often answers '
    "are right where that is so"
)


def main() -> int:
    """Run the command line.

    Returns:
        0 if every file was used, 1 if some could not be, 2 if nothing was done: the config is
        wrong, or no file could be used; 130 after Ctrl-C.
    """
    return run_command("infer", lambda tree: infer(read_recorded_config(tree)))


@steps_shown()
def infer(settings: RecordedSettings) -> int:
    """Rank the hypotheses, print the result and save it; returns the exit status."""
    space = settings.model.space
    begin("reading files")
    readings = _read(settings)
    demonstrations, problems, notes = readings
    begin("")
    for problem in problems:
        print(f"not used: {problem}", file=sys.stderr)
    for line in _together(notes):
        print(f"note: {line}", file=sys.stderr)
    if not demonstrations:
        raise ConfigError("demonstrations: no file could be used; see above")
    results = writable_results(settings)
    begin("forming the tabular model")
    model = _tabular_model(settings)
    calibration = None
    if settings.inference.calibrate:
        store = Store(results / "store")
        calibration = recorded_calibration(settings, model, demonstrations, store)
    begin(f"ranking {len(settings.candidates)} hypotheses")
    forecast_map = None if calibration is None else calibration.map
    exact_ends = settings.inference.exact_ends
    inference = mlci.preparation.infer(
        model,
        demonstrations,
        prior_none=settings.inference.prior,
        rates=settings.inference.rates(calibrated=forecast_map is not None),
        calibration=forecast_map,
        exact_ends=exact_ends,
        crossing=settings.crossing.crossing(),
        round_horizon=True,
    )
    if settings.inference.rule_breaking == ESTIMATE:
        inference = inference.with_rule_breaking()
    temperature = None
    if settings.estimate_temperature:
        begin("estimating the temperature")
        temperature = estimate_temperature(
            model, demonstrations, inference, round_horizon=True, exact_ends=exact_ends
        )
    ranking = ranking_table(inference)
    result = answer(
        model,
        demonstrations,
        inference,
        round_horizon=True,
        exact_ends=exact_ends,
        temperature=temperature,
    )
    begin("")
    for line in answer_lines(result, settings.top):
        print(line)
    if np.any(result.misfit.is_rare):
        for line in entry("see", ON_WRONG_MODELS):
            print(line)
    if calibration is not None:
        for line in entry("calibration", calibration.summary()):
            print(line)
    print(f"demonstrations  {len(demonstrations)} used, {len(problems)} files not used")
    for line in _refutation_lines(inference):
        print(line)
    unreachable = int(np.sum(~inference.reachable))
    diagnosis, count = diagnose(model), len(demonstrations)
    for line in diagnosis_lines(diagnosis, space.names, unreachable, count):
        print(line)
    begin("drawing the map")
    folder = _save(settings, demonstrations, problems, result, ranking)
    concerns = list(diagnosis.concerns(space.names, unreachable, count))
    content = _page(settings, readings, result, calibration, concerns)
    replace_file(folder / "page.html", content)
    begin("")
    print(f"written: {folder}")
    print(f"page: {folder / 'page.html'}")
    return FAILED if problems else DONE


def _read(settings: RecordedSettings) -> Readings:
    """The demonstrations that can be used, what is wrong with other files, and what was assumed."""
    readings = read_demonstrations(
        settings.demonstrations,
        settings.model,
        dt=settings.recorded_dt,
        columns=settings.columns,
        units=settings.units,
        time_unit=settings.time_unit,
        start=settings.start,
        goal=None if settings.goal is None else settings.goal.box(),
        max_memory=settings.max_memory,
    )
    usable, dt = [], settings.dt
    for demonstration in readings.demonstrations:
        duration, name = demonstration.task.horizon, demonstration.name
        try:
            refuse_long(duration, dt, settings.max_duration)
        except ValueError as error:
            readings.problems.append(Remark(name, str(error)))
            continue
        usable.append(demonstration)
        steps = max(1, round(duration / dt))
        if abs(duration / dt - steps) > ROUNDED_TIMES:
            message = f"its {duration:g} s count as {steps} steps of {dt:g} s, {steps * dt:g} s"
            readings.notes.append(Remark(name, message))
    return readings._replace(demonstrations=usable)


def _together(remarks: Sequence[Remark]) -> list[str]:
    """Remarks as lines, those of the same words in one."""
    files: dict[str, list[str]] = {}
    for remark in remarks:
        files.setdefault(remark.message, []).append(remark.file)
    return [
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {message}"
        for message, names in files.items()
    ]


def _tabular_model(settings: RecordedSettings) -> TabularModel:
    """The tabular model with all hypotheses."""
    return discretize(
        settings.model,
        settings.cells,
        settings.action_values,
        settings.dt,
        settings.candidates,
        settings.transition.samples,
        settings.temperature,
    )


def _refutation_lines(inference: Inference) -> list[str]:
    """Which hypotheses each demonstration refutes, by their numbers; * where it alone does."""
    alone = np.sum(inference.violated, axis=0) == 1
    lines = entry("", "hypotheses that each refutes (* no other does):")
    for name, violated, reachable in zip(
        inference.names, inference.violated, inference.reachable, strict=True
    ):
        numbers = [f"{i}{'*' if alone[i] else ''}" for i in np.flatnonzero(violated)]
        note = [] if reachable else ["(goal unreachable: adds no gain)"]
        lines += entry("", " ".join([name, *numbers, *note]), hang=2)
    return lines


def _save(
    settings: RecordedSettings,
    demonstrations: Sequence[Demonstration],
    problems: Sequence[Remark],
    result: Answer,
    ranking: pd.DataFrame,
) -> Path:
    """Write tables, map and record into a folder of their own, named by what went in."""
    space = settings.model.space
    paths = _path_table(demonstrations, space.names)
    # What decides the result: the settings that do, and the numbers that were read.
    made_from = {
        "config": {**plain(settings), "demonstrations": "", "results": None, "top": 0},
        "paths": digest(csv_bytes(paths)),
    }
    results = results_folder(settings) / "inference"
    folder = results / digest(canonical_json(made_from))[:16]
    tables = {"hypotheses": ranking, **_demonstration_tables(demonstrations, result.inference)}
    for name, table in tables.items():
        replace_file(folder / f"{name}.csv", csv_bytes(table))
    save(hypothesis_map.draw(ranking, paths, dimension_table(space)), folder / "map")
    replace_file(folder / "answer.json", _json_bytes(result.record()))
    record = {
        **made_from,
        "demonstrations": settings.demonstrations,
        "not_used": [str(problem) for problem in problems],
        **environment(results_folder(settings)),
    }
    replace_file(folder / "record.json", _json_bytes(record))
    return folder


def _page(
    settings: RecordedSettings,
    readings: Readings,
    result: Answer,
    calibration: Calibration | None,
    concerns: Sequence[str],
) -> bytes:
    """The page, with what reading the files assumed and all that is doubtful."""
    given = settings.demonstrations
    sources = [Path(each).name or each for each in ([given] if isinstance(given, str) else given)]
    return page(
        result,
        readings.demonstrations,
        title=f"What was avoided: {', '.join(sources)}",
        assumed=[
            *_together(readings.notes),
            *([] if calibration is None else [calibration.summary()]),
        ],
        doubtful=[*concerns, *(f"not used: {problem}" for problem in readings.problems)],
    ).encode(errors="backslashreplace")


def _json_bytes(tree: dict[str, Any]) -> bytes:
    """A tree as it is written to a file."""
    return json.dumps(tree, indent=1, allow_nan=False).encode() + b"\n"


def _path_table(demonstrations: Sequence[Demonstration], names: Sequence[str]) -> pd.DataFrame:
    """A row a sample of each demonstration."""
    samples = np.concatenate([demonstration.states for demonstration in demonstrations])
    lengths = [len(demonstration.states) for demonstration in demonstrations]
    of = np.repeat([demonstration.name for demonstration in demonstrations], lengths)
    return pd.DataFrame({"demonstration": of, **dict(zip(names, samples.T, strict=True))})


def _demonstration_tables(
    demonstrations: Sequence[Demonstration], inference: Inference
) -> dict[str, pd.DataFrame]:
    """What each demonstration is, and what it says of each hypothesis."""
    count, names = len(inference.hypotheses), list(inference.names)
    phi = np.where(inference.reachable[:, None], inference.phi, np.nan)
    return {
        "demonstrations": pd.DataFrame(
            {
                "demonstration": names,
                "duration": [demonstration.task.horizon for demonstration in demonstrations],
                "reachable": inference.reachable,
                "violated": np.sum(inference.violated, axis=1),
            }
        ),
        "violations": pd.DataFrame(
            {
                "demonstration": np.repeat(names, count),
                "hypothesis": np.tile(np.arange(count), len(names)),
                "probability": phi.ravel(),
                "violated": inference.violated.ravel(),
            }
        ),
    }
