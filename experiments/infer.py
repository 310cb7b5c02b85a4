"""Rank constraints from recorded demonstrations: python experiments/infer.py demonstrations=PATH"""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before all that takes time to import
    from experiments import app

    sys.exit(app.infer())

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np

from experiments import infer_table
from experiments.app import DONE, FAILED, run_command
from experiments.belief_lines import Beliefs, belief_lines
from experiments.config.paths import results_folder
from experiments.config.read import read_recorded_config, writable_results
from experiments.config.settings import ESTIMATE, RecordedSettings
from experiments.console import answer_lines, diagnosis_lines, doubt_lines, refutation_lines
from experiments.lookback.recordings import CALIBRATION
from experiments.page.beliefs import belief_sentences
from experiments.page.document import page
from experiments.point.beliefs import belief_record, belief_tables, recorded_beliefs
from experiments.point.forecasts import exported_calibration, recorded_calibration
from experiments.point.ranking import ranked
from experiments.point.ranking_tables import ranking_table
from experiments.point.recorded import (
    plausibilities,
    read_recordings,
    recorded_weights,
    together,
)
from experiments.point.recorded_next import candidate_tasks, recorded_next_tasks
from experiments.point.recorded_tables import demonstration_tables, path_table
from experiments.point.stages import cost_lines, formed_model
from experiments.progress import begin, steps_shown
from experiments.terminal import complain, counted, entry, say
from experiments.tracking.environment import environment
from experiments.tracking.files import csv_bytes, digest, json_bytes, replace_file
from experiments.tracking.store import Store
from experiments.tracking.trees import canonical_json, plain
from mlci.answers import Answer, answer
from mlci.calibration import Calibration
from mlci.demonstrations import Demonstration
from mlci.diagnosis import diagnose
from mlci.inference import Inference
from mlci.models import Model
from mlci.plot import draw_map, png
from mlci.recordings.files import user_path
from mlci.recordings.plausibility import Plausibility, summary
from mlci.recordings.read import Readings
from mlci.recordings.recording import Remark, shown_path
from mlci.tabular import TabularModel
from mlci.temperature import estimate_temperature

ON_WRONG_MODELS = (
    'results/paper/REPORT.md, "Demonstrators who are not the nominal model", for how often answers '
    "are right where that is so"
)

_EXPORTED = "evidence is calibrated by the tasks of the point that these demonstrations come from"
_NOT_EXPORTED = (
    "is not used, since it fits another model, other hypotheses, another kind of evidence or other "
    "source; evidence is calibrated by tasks like the recorded ones"
)


def main() -> int:
    """Run the command line.

    Returns:
        0 if every file was used, 1 if some or all could not be, 2 if nothing was done because the
        config is wrong; 130 after Ctrl-C.
    """
    if any(word.startswith("table=") for word in sys.argv[1:]):
        return infer_table.main()
    return run_command("infer", lambda tree: infer(read_recorded_config(tree)))


@steps_shown()
def infer(settings: RecordedSettings) -> int:
    """Rank the hypotheses, print the result and save it; returns the exit status."""
    space = settings.model.space
    begin("reading files")
    readings = read_recordings(settings)
    demonstrations, problems, notes = readings
    calibration, exported = None, _exported(settings)
    if settings.inference.calibrate and demonstrations and exported is not None:
        calibration = exported_calibration(settings, exported)
        remark = _NOT_EXPORTED if calibration is None else _EXPORTED
        notes.append(Remark(shown_path(exported.folder), remark))
    begin("")
    for problem in problems:
        complain(f"not used: {problem}")
    for line in together(notes):
        complain(f"note: {line}")
    if not demonstrations:
        why = "; the lines above say why" if problems else ""
        print(f"no demonstration could be used{why}")
        return FAILED
    results = writable_results(settings, "inference")
    if settings.next_tasks.count:
        candidate_tasks(settings, 1.0)  # a table that cannot be used is refused before the work
    checks = plausibilities(settings, demonstrations)
    say([*doubt_lines(checks), *cost_lines(settings)])
    begin("forming the model")
    model = formed_model(settings, settings.candidates)
    if settings.inference.calibrate and calibration is None:
        store = Store(results / "store")
        calibration = recorded_calibration(settings, model, demonstrations, store)
    result = _answer(settings, model, demonstrations, calibration, summary(checks))
    beliefs = recorded_beliefs(settings, model, demonstrations, result.inference, exported)
    begin("drawing the map")
    # All is saved before it is printed, in case nobody reads on.
    folder = _save(settings, demonstrations, problems, result, checks, beliefs)
    diagnosis = diagnose(model) if isinstance(model, TabularModel) else None
    count = len(demonstrations)
    unreachable = int(np.sum(~result.inference.reachable))
    doubtful = [check for check in checks if check.doubts]
    concerns, moving = [], list[str]()
    if diagnosis is not None:
        concerns = diagnosis.concerns(space.names, unreachable, count)
        moving = list(diagnosis_lines(diagnosis, space.names, unreachable, count))
    sentences = belief_sentences(beliefs)
    content = _page(settings, readings, result, calibration, doubtful, concerns, sentences)
    replace_file(folder / "page.html", content)
    begin("")
    for line in (
        *_answer_lines(settings, result, calibration),
        *belief_lines(beliefs, settings.top),
        f"demonstrations  {count} used, {counted(len(problems), 'file')} not used",
        *refutation_lines(result.inference),
        *moving,
        f"written: {shown_path(folder)}",
        f"page: {shown_path(folder / 'page.html')}",
    ):
        print(line)
    return FAILED if problems else DONE


def _exported(settings: RecordedSettings) -> Store | None:
    """The calibration beside a point's exported demonstrations, if these alone are ranked."""
    given = settings.demonstrations
    paths = [given] if isinstance(given, str) else given
    folder = user_path(paths[0]) / CALIBRATION
    return Store(folder) if len(paths) == 1 and folder.is_dir() else None


def _answer(
    settings: RecordedSettings,
    model: Model,
    demonstrations: Sequence[Demonstration],
    calibration: Calibration | None,
    doubts: Sequence[str],
) -> Answer:
    """The inference, seen from all sides."""
    begin(f"ranking {len(settings.candidates)} hypotheses")
    forecast_map = None if calibration is None else calibration.map
    exact_ends = settings.inference.exact_ends
    inference = ranked(
        settings,
        model,
        demonstrations,
        prior_none=settings.inference.prior,
        size_prior=settings.inference.size_prior,
        rates=settings.inference.rates(calibrated=forecast_map is not None),
        calibration=forecast_map,
        exact_ends=exact_ends,
        crossing=settings.crossing.crossing(),
        round_horizon=True,
    )
    if settings.inference.rule_breaking == ESTIMATE:
        inference = inference.with_rule_breaking()
    temperature = None
    if settings.estimate_temperature and isinstance(model, TabularModel):
        begin("estimating the temperature")
        temperature = estimate_temperature(
            model, demonstrations, inference, round_horizon=True, exact_ends=exact_ends
        )
    return answer(
        model,
        demonstrations,
        inference,
        round_horizon=True,
        exact_ends=exact_ends,
        simulated=() if calibration is None else calibration.excess,
        temperature=temperature,
        doubts=doubts,
        weights=recorded_weights(settings, model, demonstrations, inference),
        next_tasks=recorded_next_tasks(settings, model, demonstrations, inference),
    )


def _answer_lines(
    settings: RecordedSettings, result: Answer, calibration: Calibration | None
) -> list[str]:
    """The answer, where to read on if it is doubtful, and how forecasts were calibrated."""
    lines = list(answer_lines(result, settings.top))
    if result.misfit.warnings(result.inference.names):
        lines += entry("see", ON_WRONG_MODELS)
    if calibration is not None:
        lines += entry("calibration", calibration.summary())
    return lines


def _save(
    settings: RecordedSettings,
    demonstrations: Sequence[Demonstration],
    problems: Sequence[Remark],
    result: Answer,
    checks: Sequence[Plausibility],
    beliefs: Beliefs,
) -> Path:
    """Write tables, map and record into a folder of their own, named by what went in."""
    space, inference = settings.model.space, result.inference
    paths = path_table(demonstrations, space.names)
    # What decides the result: the settings that do, and the numbers that were read or simulated.
    made_from = {
        "config": {**plain(settings), "demonstrations": "", "results": None, "top": 0},
        "paths": digest(csv_bytes(paths)),
        "times": digest(b"".join(each.times.tobytes() for each in demonstrations)),
        "forecasts": plain(inference.calibration),
    }
    results = results_folder(settings) / "inference"
    folder = results / digest(canonical_json(made_from))[:16]
    tables = {
        "hypotheses": ranking_table(inference),
        **demonstration_tables(demonstrations, inference),
        **belief_tables(beliefs),
    }
    for name, table in tables.items():
        replace_file(folder / f"{name}.csv", csv_bytes(table))
    replace_file(folder / "map.png", _map(inference, demonstrations))
    answer_record = {
        **result.record(),
        **belief_record(beliefs),
        "recordings": [each.record(space) for each in checks],
    }
    replace_file(folder / "answer.json", json_bytes(answer_record))
    record = {
        **made_from,
        "demonstrations": settings.demonstrations,
        "not_used": [str(problem) for problem in problems],
        **environment(results_folder(settings)),
    }
    replace_file(folder / "record.json", json_bytes(record))
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
    beliefs: Sequence[str],
) -> bytes:
    """The page, with what reading the files assumed and all that is doubtful."""
    given = settings.demonstrations
    sources = [Path(each).name or each for each in ([given] if isinstance(given, str) else given)]
    return page(
        result,
        readings.demonstrations,
        title=f"What was avoided: {', '.join(sources)}",
        beliefs=beliefs,
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
