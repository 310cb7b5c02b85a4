"""Rank constraints of a finite world: python experiments/infer.py table=FILE demonstrations=PATH"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import mlci.worlds.inference
from experiments.app import DONE, FAILED, run_command
from experiments.config.paths import results_folder
from experiments.config.problems import ConfigError
from experiments.config.read import read_table_config, writable_results
from experiments.config.settings import TableSettings
from experiments.config.world_file import World, read_world
from experiments.console import gain_words, probability
from experiments.progress import begin, steps_shown
from experiments.terminal import complain, entry, table_lines
from experiments.tracking.environment import environment
from experiments.tracking.files import csv_bytes, digest, json_bytes, replace_file
from experiments.tracking.trees import canonical_json, plain
from mlci.credible_sets import most_probable
from mlci.evidence import Rates
from mlci.json_numbers import finite
from mlci.misfit import listed
from mlci.recordings.recording import Remark, shown_path
from mlci.recordings.table_paths import read_table_paths
from mlci.sets.search import Selection
from mlci.sets.selection import select_constraints
from mlci.worlds.inference import TableInference, is_certain
from mlci.worlds.tables import TablePath

_SHARE = 0.95  # of the posterior that the credible set holds


def main() -> int:
    """Run the command line; returns what `experiments.infer.main` does."""
    return run_command("infer_table", lambda tree: infer_table(read_table_config(tree)))


@steps_shown()
def infer_table(settings: TableSettings) -> int:
    """Rank the hypotheses, print the result and save it; returns the exit status."""
    begin("reading files")
    world, given = read_world(settings.table), settings.demonstrations
    paths, problems = read_table_paths(
        [given] if isinstance(given, str) else given,
        world.table,
        world.states,
        world.actions,
        world.horizon,
    )
    begin("")
    for problem in problems:
        complain(f"not used: {problem}")
    if not paths:
        print("no demonstration could be used")
        return FAILED
    writable_results(settings, "inference")
    begin(f"ranking {len(world.table.regions)} hypotheses")
    rates = Rates(settings.inference.model_error, settings.inference.rule_breaking)
    try:
        inference = mlci.worlds.inference.infer_table(
            world.table,
            paths,
            steps=world.horizon,
            discount=world.discount,
            prior_none=settings.inference.prior,
            rates=rates,
        )
        selection = None
        if is_certain(world.table, world.discount):
            begin("selecting several")
            selection = select_constraints(world.table, paths, settings.least, steps=world.horizon)
    except ValueError as error:  # the world has no distribution
        raise ConfigError(f"{settings.table}: {error}") from None
    # All is saved before it is printed, in case nobody reads on.
    folder = _save(settings, world, paths, problems, inference, selection)
    begin("")
    for line in (
        *_ranking_lines(inference, settings.top),
        *_selection_lines(selection, settings.least),
        *entry("assumed", "; ".join(_assumptions(world, inference))),
        *_path_lines(paths, problems, inference),
        f"written: {shown_path(folder)}",
    ):
        print(line)
    return FAILED if problems else DONE


def _ranking_lines(inference: TableInference, top: int) -> list[str]:
    """Which hypothesis comes first, the first few, and the credible set."""
    ranking, names = inference.ranking, inference.hypotheses
    first, none = ranking.order[0], probability(ranking.posterior_none)
    if ranking.gain[first] > 0:
        lines = entry(
            "answer",
            f"{names[first]} is the most likely, with probability "
            f"{probability(ranking.posterior[first])}; no constraint {none}",
        )
    else:
        lines = entry("answer", f"nothing is more likely than none, whose probability is {none}")
    shown = [i for i in ranking.order[:top].tolist() if ranking.gain[i] > -np.inf]
    rows = [
        (names[i], gain_words(ranking.gain[i]).rjust(10), probability(ranking.posterior[i]))
        for i in shown
    ]
    head = ("hypothesis", "gain [nat]", "posterior")
    lines += [f"  {line}" for line in table_lines([head, *rows])]
    numbers, has_none, _ = most_probable(ranking.posterior, ranking.posterior_none, _SHARE)
    members = [*(["no constraint"] * has_none), *(names[i] for i in numbers)]
    return lines + entry(f"{100 * _SHARE:g} % credible", listed(members))


def _selection_lines(selection: Selection | None, least: float) -> list[str]:
    """Several constraints in the order in which they explain, or why there are none."""
    if selection is None:
        return entry(
            "several", "are not selected: the KL divergence is of trajectories whose moves are "
            "certain, without a discount"
        )  # fmt: skip
    lines = entry(
        "several",
        f"added one by one, by the KL divergence of the paths, {selection.kl[0]:.4g} nat without a "
        "constraint:",
    )
    if len(selection.added):
        rows = [
            (selection.names[i], f"{decrease:.3f}".rjust(14), f"{after:.3f}".rjust(8))
            for i, decrease, after in zip(
                selection.added, -np.diff(selection.kl), selection.kl[1:], strict=True
            )
        ]
        head = ("hypothesis", "decrease [nat]", "KL [nat]")
        lines += [f"  {line}" for line in table_lines([head, *rows])]
    return lines + entry(
        "",
        f"the next would lower it by {selection.next_decrease:.3g}, no more than least={least:g}",
    )


def _assumptions(world: World, inference: TableInference) -> list[str]:
    """What the answer takes for granted, a phrase each."""
    if is_certain(world.table, world.discount):
        length = "any length" if world.horizon is None else f"{world.horizon} moves"
        model = f"trajectories of {length} have probability e^reward / Z"
    else:
        horizon = "for ever" if world.horizon is None else f"for {world.horizon} steps"
        discount = f", discount {world.discount:g}" if world.discount < 1 else ""
        model = (
            f"a policy of maximum causal entropy {horizon}{discount}; evidence is the ratio of two "
            "such policies, not that of trajectories"
        )
    return [
        model,
        "at most one hypothesis is forbidden, in the ranking",
        f"prior of none {inference.prior_none:g}, the rest shared equally",
        f"model error {inference.rates.model_error:g}",
        f"rule breaking {inference.rates.rule_breaking:g}",
        f"temperature {world.temperature:g}",
    ]


def _path_lines(
    paths: Sequence[TablePath], problems: Sequence[Remark], inference: TableInference
) -> list[str]:
    """How many paths were used, and what no path violates."""
    left = int(np.sum(~inference.violated.any(axis=0)))
    return entry(
        "demonstrations",
        f"{len(paths)} used, {len(problems)} not used; {left} of {len(inference.hypotheses)} "
        "hypotheses are violated by none",
    )


def _save(
    settings: TableSettings,
    world: World,
    paths: Sequence[TablePath],
    problems: Sequence[Remark],
    inference: TableInference,
    selection: Selection | None,
) -> Path:
    """Write tables and answer into a folder of their own, named by what went in."""
    table = world.table
    parts = (
        *(table.transitions.data, table.transitions.indices, table.transitions.indptr),
        *(table.reward, table.start, table.goals),
        *(table.crosses.indices, table.crosses.indptr),
        *(part for path in paths for part in (path.states, path.actions)),
    )
    made_from = {
        "config": {**plain(settings), "demonstrations": "", "table": "", "results": None, "top": 0},
        "names": [world.states, world.actions, list(table.regions), inference.names],
        "horizon": world.horizon,
        "discount": world.discount,
        "arrays": digest(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)),
    }
    results = results_folder(settings)
    folder = results / "inference" / digest(canonical_json(plain(made_from)))[:16]
    replace_file(folder / "hypotheses.csv", csv_bytes(inference.to_frame()))
    if selection is not None:
        replace_file(folder / "selection.csv", csv_bytes(selection.to_frame()))
    record = {
        **made_from,
        "demonstrations": settings.demonstrations,
        "table": settings.table,
        "not_used": [str(problem) for problem in problems],
        **environment(results),
    }
    for name, tree in (
        ("answer", _answer_record(world, paths, inference, selection)),
        ("record", record),
    ):
        replace_file(folder / f"{name}.json", json_bytes(plain(tree)))
    return folder


def _answer_record(
    world: World,
    paths: Sequence[TablePath],
    inference: TableInference,
    selection: Selection | None,
) -> dict[str, Any]:
    """The answer for programs; infinite numbers are None."""
    ranking, names = inference.ranking, inference.hypotheses
    first = int(ranking.order[0])
    numbers, has_none, held = most_probable(ranking.posterior, ranking.posterior_none, _SHARE)
    several = None
    if selection is not None:
        several = {
            "added": [names[i] for i in selection.added],
            "kl": selection.kl.tolist(),
            "next_decrease": selection.next_decrease,
        }
    return {
        "first": {
            "hypothesis": names[first],
            "gain": finite(ranking.gain[first]),
            "posterior": float(ranking.posterior[first]),
        },
        "posterior_none": float(ranking.posterior_none),
        "credible_set": {
            "share": _SHARE,
            "probability": held,
            "no_constraint": has_none,
            "hypotheses": [names[i] for i in numbers],
        },
        "selection": several,
        "assumptions": _assumptions(world, inference),
        "demonstrations": [
            {
                "name": name,
                "moves": len(path.actions),
                "evidence_for_first": finite(evidence[first]),
                "violates": [names[i] for i in np.flatnonzero(violated)],
            }
            for name, path, evidence, violated in zip(
                inference.names, paths, inference.evidence, inference.violated, strict=True
            )
        ],
    }
