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

import matplotlib
import numpy as np
import pandas as pd

import mlci.preparation
from experiments.app import DONE, FAILED, run_command
from experiments.config.paths import results_folder
from experiments.config.read import read_recorded_config, writable_results
from experiments.config.settings import ESTIMATE, RecordedSettings
from experiments.console import answer_lines, diagnosis_lines
from experiments.page.document import page
from experiments.point.forecasts import recorded_calibration
from experiments.point.ranking_tables import ranking_table
from experiments.point.recorded import plausibilities, read_recordings, together
from experiments.progress import begin, steps_shown
from experiments.terminal import complain, counted, entry
from experiments.tracking.environment import environment
from experiments.tracking.files import csv_bytes, digest, replace_file
from experiments.tracking.store import Store
from experiments.tracking.trees import canonical_json, plain
from mlci.answers import Answer, answer
from mlci.calibration import Calibration
from mlci.demonstrations import Demonstration
from mlci.diagnosis import diagnose
from mlci.inference import Inference
from mlci.plot import draw_map, png
from mlci.recordings.plausibility import Plausibility, summary
from mlci.recordings.read import Readings
from mlci.recordings.recording import Remark, shown_path
from mlci.tabular import TabularModel, discretize
from mlci.temperature import estimate_temperature

ON_WRONG_MODELS = (
    'results/paper/REPORT.md, "Demonstrators who are not the nominal model", for how often answers '
    "are right where that is so"
)


def main() -> int:
    """Run the command line.

    Returns:
        0 if every file was used, 1 if some or all could not be, 2 if nothing was done because the
        config is wrong; 130 after Ctrl-C.
    """
    return run_command("infer", lambda tree: infer(read_recorded_config(tree)))


@steps_shown()
def infer(settings: RecordedSettings) -> int:
    """Rank the hypotheses, print the result and save it; returns the exit status."""
    space = settings.model.space
    begin("reading files")
    readings = read_recordings(settings)
    demonstrations, problems, notes = readings
    begin("")
    for problem in problems:
        complain(f"not used: {problem}")
    for line in together(notes):
        complain(f"note: {line}")
    if not demonstrations:
        lacking = f": {len(problems)} lack what is named above" if problems else ""
        print(f"no demonstration could be used{lacking}")
        return FAILED
    results = writable_results(settings)
    checks = plausibilities(settings, demonstrations)
    for line in _doubt_lines(checks):
        print(line)
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
        doubts=summary(checks),
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
    print(f"demonstrations  {len(demonstrations)} used, {counted(len(problems), 'file')} not used")
    for line in _refutation_lines(inference):
        print(line)
    unreachable = int(np.sum(~inference.reachable))
    diagnosis, count = diagnose(model), len(demonstrations)
    for line in diagnosis_lines(diagnosis, space.names, unreachable, count):
        print(line)
    begin("drawing the map")
    folder = _save(settings, demonstrations, problems, result, ranking, checks)
    doubtful = [check for check in checks if check.doubts]
    concerns = list(diagnosis.concerns(space.names, unreachable, count))
    content = _page(settings, readings, result, calibration, doubtful, concerns)
    replace_file(folder / "page.html", content)
    begin("")
    print(f"written: {shown_path(folder)}")
    print(f"page: {shown_path(folder / 'page.html')}")
    return FAILED if problems else DONE


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


def _doubt_lines(checks: Sequence[Plausibility]) -> list[str]:
    """A paragraph for each recording that is doubtful, and how many are not."""
    doubtful = [check for check in checks if check.doubts]
    lines = [line for check in doubtful for line in entry("doubtful", str(check), hang=2)]
    good = len(checks) - len(doubtful)
    return lines + entry("recordings", f"{good} of {len(checks)} are plausible")


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
    checks: Sequence[Plausibility],
) -> Path:
    """Write tables, map and record into a folder of their own, named by what went in."""
    space, inference = settings.model.space, result.inference
    paths = _path_table(demonstrations, space.names)
    # What decides the result: the settings that do, and the numbers that were read.
    made_from = {
        "config": {**plain(settings), "demonstrations": "", "results": None, "top": 0},
        "paths": digest(csv_bytes(paths)),
        "times": digest(b"".join(each.times.tobytes() for each in demonstrations)),
    }
    results = results_folder(settings) / "inference"
    folder = results / digest(canonical_json(made_from))[:16]
    tables = {"hypotheses": ranking, **_demonstration_tables(demonstrations, inference)}
    for name, table in tables.items():
        replace_file(folder / f"{name}.csv", csv_bytes(table))
    replace_file(folder / "map.png", _map(inference, demonstrations))
    answer_record = {**result.record(), "recordings": [each.record(space) for each in checks]}
    replace_file(folder / "answer.json", _json_bytes(answer_record))
    record = {
        **made_from,
        "demonstrations": settings.demonstrations,
        "not_used": [str(problem) for problem in problems],
        **environment(results_folder(settings)),
    }
    replace_file(folder / "record.json", _json_bytes(record))
    return folder


def _map(inference: Inference, demonstrations: Sequence[Demonstration]) -> bytes:
    """The map as a PNG; a user's own matplotlibrc, such as text.usetex, is for other figures."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        return png(draw_map(inference, demonstrations))


def _page(
    settings: RecordedSettings,
    readings: Readings,
    result: Answer,
    calibration: Calibration | None,
    doubtful: Sequence[Plausibility],
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
            *together(readings.notes),
            *([] if calibration is None else [calibration.summary()]),
        ],
        doubtful=[
            *map(str, doubtful),
            *concerns,
            *(f"not used: {problem}" for problem in readings.problems),
        ],
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
