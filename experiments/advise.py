"""Compare discretisations of a system, and recommend one: python experiments/advise.py"""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before all that takes time to import
    from experiments import app

    sys.exit(app.advise())

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from tqdm import tqdm

from experiments.app import DONE, FAILED, run_command
from experiments.config.read import ConfigError, read_advice_config
from experiments.config.settings import AdviceSettings
from experiments.console import noise_words
from experiments.point.model_choice import choose_model, formed_cells
from experiments.success_rule import SuccessRule, chance_word, chance_words, read_rule
from experiments.terminal import entry, table_lines, terminal_width, words
from mlci.demonstrations import Demonstration
from mlci.demonstrator import Outcome, demonstrate, sample_trials
from mlci.diagnosis import MOST_UNREACHABLE, Diagnosis
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.outlook.outlook import Outlook, outlook
from mlci.spaces import Bools

_SAMPLES = 100  # of the paths that show which tasks can be done
# A remedy that takes more moves is not tried: some 30 s and 1 GB.
_MOST_MOVES = 4_000_000
# A step that crosses fewer cells loses too much by starting anew from a cell's centre, up to half
# a cell away. On the pendulum the final-state error falls by a third from 1 cell a step to 2.
_CELLS_A_STEP = 2.0


@dataclass(frozen=True, eq=False)
class Candidate:
    """A discretisation that was tried.

    Attributes:
        grid: its cells.
        dt: time step [s].
        samples: start points of a cell, along each dimension.
        diagnosis: how it moves.
        reached: (P,) which tasks' goals the tabular agent can reach.
        coarse: whether its cells are wider than half a hypothesis.
        known: what is known of inference in it before anybody demonstrates; None if nothing.
        discretize_s: processor time that it took to form [s].
        task_s: processor time that the inference of one task takes [s].
    """

    grid: Grid
    dt: float
    samples: int
    diagnosis: Diagnosis
    reached: Bools
    coarse: bool
    discretize_s: float
    task_s: float
    known: Outlook | None = None

    @property
    def moves(self) -> int:
        """Start points times cells, to which its cost is proportional."""
        return self.grid.size * self.samples ** len(self.grid.shape)

    @property
    def shape(self) -> str:
        """Its cells along each dimension, in words."""
        return "x".join(map(str, self.grid.shape))

    @property
    def accepted(self) -> bool:
        """Whether the tabular agent reaches the goals."""
        return bool(np.mean(~self.reached) <= MOST_UNREACHABLE)

    @property
    def concerns(self) -> list[str]:
        """What is wrong with it."""
        unreachable = int(np.sum(~self.reached))
        return self.diagnosis.concerns(self.grid.space.names, unreachable, len(self.reached))


def main() -> int:
    """Run the command line.

    Returns:
        0 if a discretisation is recommended, 1 if none is, 2 if the config is wrong, 130 after
        Ctrl-C.
    """
    return run_command("advise", lambda tree: advise(read_advice_config(tree), print))


def advise(settings: AdviceSettings, log: Callable[[str], None]) -> int:
    """Try the discretisations, print what was found and recommend one; returns the exit status."""
    paths = _paths(settings)
    text = (
        f"{len(paths)} of {settings.pairs} that were drawn, {settings.horizon:g} s each: those "
        "whose cheapest path keeps within the ranges of states and controls, so that a good "
        "tabular agent can do them"
    )
    for line in entry("tasks", text):
        log(line)
    candidates, rule = list(_try_all(settings, paths)), read_rule()
    for line in table_lines([_HEAD, *(_row(each, rule) for each in candidates)], terminal_width()):
        log(line)
    for title, text in _COLUMNS.items():
        for line in entry(title, text):
            log(line)
    for candidate in candidates:
        for number, concern in enumerate(candidate.concerns):
            for line in entry("" if number else _name(candidate), concern):
                log(line)
    chosen, reasons = recommend(candidates)
    if chosen is None:
        log("recommended     none: raise budget, add larger dts or grids, or try another remedy")
        choose_model(settings, paths, None, settings.dts[0], log)
        return FAILED
    shape = ",".join(map(str, chosen.grid.shape))
    log(
        f"recommended     grid.shape=[{shape}] dt={chosen.dt:g} transition.samples={chosen.samples}"
    )
    for reason in reasons:
        for line in entry("", reason):
            log(line)
    if chosen.known is not None:
        for line in entry("works", " ".join(chance_words(chosen.known, rule))):
            log(line)
    cells = formed_cells(settings, chosen.grid, chosen.dt, chosen.samples)
    choose_model(settings, paths, cells, chosen.dt, log)
    return DONE


def recommend(candidates: Sequence[Candidate]) -> tuple[Candidate | None, list[str]]:
    """The cheapest discretisation without a fault, and why.

    Each rule keeps those that meet it, unless none does: goals can be reached; the diagnosis has
    no other concern; no cell is wider than half a hypothesis, so that a cell seldom stands for
    two; a step crosses at least two cells; the fewest moves; the shortest time step.
    """
    left = [each for each in candidates if each.accepted]
    if not left:
        return None, []
    reasons = ["the tabular agent reaches the goals"]
    for holds, reason, otherwise in (
        (
            lambda each: not each.concerns,
            "the diagnosis finds nothing wrong",
            "every one that reaches them has a concern: see above",
        ),
        (
            lambda each: not each.coarse,
            "its cells are at most half as wide as the hypotheses",
            "its cells are wider than half a hypothesis: a larger budget would rank more sharply",
        ),
        (
            lambda each: each.diagnosis.cells_crossed >= _CELLS_A_STEP,
            f"a step crosses {_CELLS_A_STEP:g} cells or more, so that rounding to cells matters "
            "little",
            f"a step crosses fewer than {_CELLS_A_STEP:g} cells: rounding to cells is felt",
        ),
    ):
        kept = [each for each in left if holds(each)]
        reasons.append(reason if kept else otherwise)
        left = kept or left
    chosen = min(left, key=lambda each: (each.moves, each.dt))
    reasons.append("of all such, the fewest cells, and then the shortest time step")
    return chosen, reasons


def _paths(settings: AdviceSettings) -> list[Demonstration]:
    """Optimal paths of tasks from the task box that can be done: whether a grid can do them is then
    its merit.

    Raises:
        ConfigError: there is none.
    """
    system, limits = settings.model, settings.model.control_box
    drawn = sample_trials(
        system,
        None,
        settings.tasks.start_box(system.space),
        trials=settings.pairs,
        seed=settings.seed,
        horizon=settings.horizon,
        dt=settings.horizon / _SAMPLES,
        goal_offsets=settings.tasks.goal_offsets,
    )
    done = [
        attempt.demonstration
        for attempt in demonstrate(system, drawn, None, None, dt=settings.horizon / _SAMPLES)
        if attempt.outcome is Outcome.KEPT
        and attempt.demonstration.controls is not None
        and np.all(limits.contains(attempt.demonstration.controls))
    ]
    if not done:
        raise ConfigError(
            f"tasks: none of the {settings.pairs} that were drawn can be done in "
            f"{settings.horizon:g} s within the ranges of states and controls; narrow tasks, or "
            "raise pairs or horizon"
        )
    return done


def _try_all(settings: AdviceSettings, paths: Sequence[Demonstration]) -> Iterator[Candidate]:
    """Every grid and time step; where the centres of the cells fail, with the remedy as well."""
    todo = [(grid, dt, 1) for grid in settings.grids_to_try for dt in settings.dts]
    with tqdm(total=len(todo), unit="model", leave=False, disable=None) as bar:
        while todo:
            grid, dt, samples = todo.pop(0)
            bar.set_postfix_str(f"{grid.size} cells, dt {dt:g} s, samples {samples}")
            candidate = _try(settings, grid, dt, samples, paths)
            yield candidate
            bar.update()
            moves = grid.size * len(settings.action_values) * settings.remedy ** len(grid.shape)
            if not candidate.accepted and samples < settings.remedy and moves <= _MOST_MOVES:
                todo.insert(0, (grid, dt, settings.remedy))
                bar.total = len(todo) + bar.n


def _try(
    settings: AdviceSettings, grid: Grid, dt: float, samples: int, paths: Sequence[Demonstration]
) -> Candidate:
    """Form a tabular model and see what it can do."""
    before = time.process_time()
    model = formed_cells(settings, grid, dt, samples)
    formed = time.process_time() - before
    known = outlook(model, paths)
    task_s = np.nan
    if known.reachable.any():
        task = paths[int(np.argmax(known.reachable))].task
        first = TrajectoryDistribution.of_task(model, task)
        for _ in range(2):  # the second time without what all tasks share
            before = time.process_time()
            replace(first).violation_probabilities()
            task_s = time.process_time() - before
    widths = settings.candidates.upper - settings.candidates.lower
    return Candidate(
        grid=grid,
        dt=dt,
        samples=samples,
        diagnosis=known.diagnosis,
        reached=known.reachable,
        coarse=bool(np.any(grid.widths > widths / 2 * (1 + 1e-9))),
        discretize_s=formed,
        task_s=task_s,
        known=known,
    )


_COLUMNS = {
    "goals": "share of the tasks' goals that the tabular agent reaches",
    "frozen": "largest share of cells whose number in a dimension no action changes",
    "cells/step": "crossed on average",
    "leave": "share of the moves that leave the state space",
    "noise": "control noise var(u) dt, of what it would be without limits",
    "works": "how often the truth is among the first hypotheses, as foretold below",
    "form, task": "processor time to form the model, and to infer from a task",
}
_HEAD = (
    "grid", "states", "dt", "samples", "verdict", "goals", "frozen", "cells/step", "leave", "noise",
    "works", "form [s]", "task [ms]",
)  # fmt: skip


def _row(candidate: Candidate, rule: SuccessRule) -> tuple[object, ...]:
    """A candidate in the table."""
    found, names = candidate.diagnosis, candidate.grid.space.names
    worst = int(np.argmax(found.frozen))
    verdict = "rejected"
    if candidate.accepted:
        verdict = "accepted, with a concern" if candidate.concerns else "accepted"
    return (
        candidate.shape,
        candidate.grid.size,
        candidate.dt,
        candidate.samples,
        verdict,
        f"{np.mean(candidate.reached):.0%}",
        f"{found.frozen[worst]:.0%} {words(names[worst])}",
        f"{found.cells_crossed:.1f}",
        f"{found.leave:.0%}",
        noise_words(found),
        chance_word(candidate.known, rule),
        f"{candidate.discretize_s:.2g}",
        f"{1e3 * candidate.task_s:.2g}" if candidate.reached.any() else "-",
    )


def _name(candidate: Candidate) -> str:
    """A candidate in a list of faults."""
    averaged = f", samples {candidate.samples}" if candidate.samples > 1 else ""
    return f"{candidate.shape}, {candidate.dt:g} s{averaged}"
