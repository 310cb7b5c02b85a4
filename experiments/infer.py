"""Rank constraints from recorded demonstrations: python experiments/infer.py demonstrations=PATH"""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before all that takes time to import
    from experiments import app

    sys.exit(app.infer())

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.app import DONE, FAILED, run_command
from experiments.config.paths import results_folder
from experiments.config.read import ConfigError, read_recorded_config
from experiments.config.settings import RecordedSettings
from experiments.console import diagnosis_lines, ranking_lines
from experiments.point.tables import dimension_table, ranking_table
from experiments.tracking.environment import environment
from experiments.tracking.files import csv_bytes, digest, replace_file
from experiments.tracking.trees import canonical_json, plain
from mlci.demonstrations import Demonstration
from mlci.maxent import expected_violations
from mlci.metrics import diagnose
from mlci.recordings.read import Problem, read_demonstrations
from mlci.spaces import Bools
from mlci.tabular import action_grid, discretize
from paper_figures import hypothesis_map
from paper_figures.style import save

_UNEVEN = 1e-3  # of a time step: how far a duration may be off, for times that were rounded


def main() -> int:
    """Run the command line.

    Returns:
        0 if every file was used, 1 if some could not be, 2 if nothing was done: the config is
        wrong, or no file could be used; 130 after Ctrl-C.
    """
    return run_command("infer", lambda tree: infer(read_recorded_config(tree)))


def infer(settings: RecordedSettings) -> int:
    """Rank the hypotheses, print the result and save it; returns the exit status."""
    system, grid, space = settings.model, settings.cells, settings.model.space
    demonstrations, steps, problems = _usable(settings)
    for problem in problems:
        print(f"not used: {problem}", file=sys.stderr)
    if not demonstrations:
        raise ConfigError("demonstrations: no file could be used; see above")

    actions = action_grid(system, list(settings.action_counts))
    mdp = discretize(
        system,
        grid,
        actions,
        settings.dt,
        settings.candidates,
        settings.transition.samples,
        settings.temperature,
    )
    starts = [int(grid.index(shown.task.start)) for shown in demonstrations]
    goals = [grid.cells_in(shown.task.goal) for shown in demonstrations]
    phi, reachable = expected_violations(mdp, starts, goals, steps)
    violated = np.array([settings.candidates.violated_by(shown.states) for shown in demonstrations])
    ranking = ranking_table(settings.candidates, phi[reachable], violated, settings.inference.prior)

    print(f"demonstrations  {len(demonstrations)} used, {len(problems)} files not used")
    for line in _refutation_lines(demonstrations, violated, reachable):
        print(line)
    diagnosis = diagnose(system, grid, actions, settings.dt, mdp)
    unreachable = int(np.sum(~reachable))
    for line in diagnosis_lines(diagnosis, space.names, unreachable, len(demonstrations)):
        print(line)
    for line in ranking_lines(ranking, space, settings.top):
        print(line)
    folder = _save(settings, demonstrations, problems, ranking, phi, violated, reachable)
    print(f"written: {folder}")
    return FAILED if problems else DONE


def _usable(
    settings: RecordedSettings,
) -> tuple[list[Demonstration], list[int], list[Problem]]:
    """The demonstrations that can be used, their numbers of time steps, and what is wrong."""
    goal = None if settings.goal is None else settings.goal.box()
    read, problems = read_demonstrations(
        settings.demonstrations,
        settings.model,
        dt=settings.recorded_dt,
        start=settings.start,
        goal=goal,
    )
    used, steps = [], []
    for shown in read:
        duration = shown.task.horizon
        count = round(duration / settings.dt)
        off = abs(count * settings.dt - duration)
        if not settings.round_horizon and (count < 1 or off > _UNEVEN * settings.dt):
            message = (
                f"dt = {settings.dt:g} s does not cut its {duration:g} s into whole steps: choose "
                "another dt, or set round_horizon=true"
            )
            problems.append(Problem(shown.name, message))
            continue
        steps.append(max(1, count))
        used.append(shown)
    return used, steps, problems


def _refutation_lines(
    demonstrations: Sequence[Demonstration], violated: Bools, reachable: Bools
) -> list[str]:
    """Which hypotheses each demonstration refutes, by their numbers; * where it alone does."""
    alone = np.sum(violated, axis=0) == 1
    lines = ["      hypotheses that each refutes (* no other does):"]
    width = max(len(shown.name) for shown in demonstrations)
    for shown, row, reached in zip(demonstrations, violated, reachable, strict=True):
        numbers = [f"{i}{'*' if alone[i] else ''}" for i in np.flatnonzero(row)]
        note = "" if reached else "  (goal unreachable: adds no gain)"
        lines.append(f"      {shown.name:{width}}  {' '.join(numbers)}{note}")
    return lines


def _save(
    settings: RecordedSettings,
    demonstrations: Sequence[Demonstration],
    problems: Sequence[Problem],
    ranking: pd.DataFrame,
    phi: np.ndarray,
    violated: Bools,
    reachable: Bools,
) -> Path:
    """Write tables, map and record into a folder of their own, named by what went in."""
    space, names = settings.model.space, [shown.name for shown in demonstrations]
    paths = pd.DataFrame(
        {
            "demonstration": np.repeat(names, [len(shown.states) for shown in demonstrations]),
            **dict(
                zip(space.names, np.concatenate([d.states for d in demonstrations]).T, strict=True)
            ),
        }
    )
    # What decides the result: the settings that do, and the numbers that were read.
    made_from = {
        "config": {**plain(settings), "demonstrations": "", "results": None, "top": 0},
        "paths": digest(csv_bytes(paths)),
    }
    results = results_folder(settings) / "inference"
    folder = results / digest(canonical_json(made_from))[:16]
    count = len(settings.candidates)
    tables = {
        "hypotheses": ranking,
        "demonstrations": pd.DataFrame(
            {
                "demonstration": names,
                "duration": [shown.task.horizon for shown in demonstrations],
                "reachable": reachable,
                "violated": np.sum(violated, axis=1),
            }
        ),
        "violations": pd.DataFrame(
            {
                "demonstration": np.repeat(names, count),
                "hypothesis": np.tile(np.arange(count), len(names)),
                "probability": np.where(reachable[:, None], phi, np.nan).ravel(),
                "violated": violated.ravel(),
            }
        ),
    }
    for name, table in tables.items():
        replace_file(folder / f"{name}.csv", csv_bytes(table))
    save(hypothesis_map.draw(ranking, paths, dimension_table(space)), folder / "map")
    record = {
        **made_from,
        "demonstrations": settings.demonstrations,
        "not_used": [str(problem) for problem in problems],
        **environment(results_folder(settings)),
    }
    replace_file(folder / "record.json", json.dumps(record, indent=1).encode() + b"\n")
    return folder
