"""A Hydra sweeper that checks every point first, runs those that are missing, then collates."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.plugins import Plugins
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig
from tqdm import tqdm

from experiments.collate.current import is_current
from experiments.config.explain import explain
from experiments.config.paths import results_folder
from experiments.config.read import ConfigError, resolved_tree, writable_results
from experiments.config.settings import StudySettings, SweepSettings
from experiments.sweep.combinations import Combinations
from experiments.sweep.composer import Composer
from experiments.sweep.messages import SweepFailed, describe_failures, describe_problems
from experiments.sweep.plan import Job, PlannedPoint, count_states, read_point, select_points
from experiments.sweep.pool import PoolLauncher
from experiments.sweep.runner import run_points
from experiments.sweep.worker import run_task
from experiments.terminal import counted, job_names
from experiments.tracking.files import digest
from experiments.tracking.locks import StudyInUse, plan_lock, publication_lock, sweep_lock
from experiments.tracking.points import State
from experiments.tracking.study import whole_study, write_plan


class Planner(Sweeper):
    """All combinations of the swept values, each with every case, as one batch for any launcher.

    What a study's file says to it is in `sweep.combinations`.
    """

    def __init__(self, **study: Any) -> None:
        self._combinations = Combinations(**study)

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        # The task of a single run ends the process when it fails; a sweep's point fails alone.
        self._loader, self._base = hydra_context.config_loader, config
        resolved_tree(config.hydra.sweeper)  # refuses what records must not hold
        self._launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=run_task, config=config
        )

    def sweep(self, arguments: list[str]) -> None:
        """Plan, launch and collate.

        Raises:
            ConfigError: some point cannot be run; then none is.
            SweepFailed: some points failed, after all others ran; then no table is written.
        """
        parser = OverridesParser.create(config_loader=self._loader)
        jobs = self._combinations.overrides(arguments, parser)
        plan, study = self._plan(jobs)
        options, folder = study.sweep, results_folder(study) / (study.study or _own_name(plan))
        selection = select_points(plan, options)
        if not options.dry_run:
            writable_results(study, "points")
        print(
            f"{counted(len(plan), 'point')}: {count_states(plan)}; {len(selection)} to run",
            flush=True,
        )
        if len(plan) < len(jobs):
            print(f"{len(jobs) - len(plan)} of {len(jobs)} combinations repeat others")
        for note in self._combinations.notes:
            print(note, flush=True)
        _refuse_replacement(plan, folder, options)
        if options.dry_run:
            _print_plan(plan, selection)
            return
        try:
            with sweep_lock(folder, [planned.point.identity for planned in plan]):
                self._run(plan, folder, study)
        except StudyInUse as error:
            raise ConfigError(str(error)) from None

    def _run(self, plan: Sequence[PlannedPoint], folder: Path, study: StudySettings) -> None:
        """Run what is missing of a plan, and collate; errors as of `sweep`."""
        options = study.sweep
        with plan_lock(folder.parent):
            write_plan(folder, [(each.point, each.job) for each in plan], study.examples)
            plan = [_planned_again(planned) for planned in plan]
        selection = select_points(plan, options)
        outcome = run_points(
            selection, lambda jobs: self._launcher.launch(jobs, initial_job_idx=0), options
        )
        if outcome.failures:
            raise SweepFailed(describe_failures(outcome, len(plan)))
        finished = {*selection, *(p for p in plan if p.state in (State.DONE, State.STALE))}
        if len(finished) < len(plan):
            left = len(plan) - len(finished)
            print(f"{left} of {counted(len(plan), 'point')} left, and no table is written")
            return
        points = [planned.point for planned in plan]
        with publication_lock(folder):
            if is_current(points, folder, mixed=options.mix_sources):
                print(f"up to date: {folder / 'tables'}")
                return
            from experiments.collate.join import collate  # pandas

            tables = collate(points, folder, mixed=options.mix_sources)
            print(f"written: {counted(len(tables), 'table')} in {folder / 'tables'}")

    def _plan(self, jobs: Sequence[Sequence[str]]) -> tuple[list[PlannedPoint], StudySettings]:
        """Compose and check every point; of equal ones the first stays."""
        plan: dict[str, PlannedPoint] = {}
        composer, trees = Composer(self._loader, self._base), dict[Job, dict[str, Any]]()
        studies: list[StudySettings] = []
        problems: dict[str, list[str]] = {}
        bar = tqdm(jobs, desc="checking points", unit="point", leave=False, disable=None)
        for job, name in zip(bar, job_names(jobs), strict=True):
            try:
                tree = composer.tree(job)
                point, _, study = read_point(tree)
            except Exception as error:
                for line in explain(error).splitlines():
                    problems.setdefault(line, []).append(name)
                continue
            if point.identity not in plan:
                plan[point.identity] = PlannedPoint(tuple(job), name, point, point.state())
                trees[tuple(job)] = tree
            studies.append(study)
        if problems:
            raise ConfigError(describe_problems(problems, len(jobs)))
        _refuse_several(studies)
        if isinstance(self._launcher, PoolLauncher):
            self._launcher.names = {planned.job: planned.name for planned in plan.values()}
            self._launcher.composed = trees
        return list(plan.values()), study


def _own_name(plan: Sequence[PlannedPoint]) -> str:
    """The name of a sweep that was given none: the same for the same points."""
    identities = sorted(planned.point.identity for planned in plan)
    return f"sweep_{digest(' '.join(identities).encode())[:8]}"


def _refuse_replacement(plan: Sequence[PlannedPoint], folder: Path, options: SweepSettings) -> None:
    """Raise if a study of that name has points that this sweep would leave out of it."""
    before = whole_study(folder)
    left_out = set(before.points if before else ()) - {each.point.identity for each in plan}
    if before is None or not left_out or options.replace:
        return
    message = (
        f"study: {folder.name} has {len(before.points)} points, and {len(left_out)} of them are "
        "not in this sweep, whose tables would take the place of theirs; give it a name of its "
        "own, study=..., or say sweep.replace=true"
    )
    if not options.dry_run:
        raise ConfigError(message)
    print(message)


def _planned_again(planned: PlannedPoint) -> PlannedPoint:
    """A point as it is now that its study lists it: what was done may have been cleaned away."""
    was_there = planned.state in (State.DONE, State.STALE)
    if was_there and not (planned.point.folder / "record.json").exists():
        return dataclasses.replace(planned, state=State.MISSING)
    return planned


def _refuse_several(studies: Sequence[StudySettings]) -> None:
    """Raise if points differ in what is one for a sweep, such as by `results=out/${seed}`."""
    for key in ("study", "results", "workers", "sweep"):
        first, *others = dict.fromkeys(getattr(study, key) for study in studies)
        if others:
            raise ConfigError(
                f"{key}: {first} for one point and {others[0]} for another, but a sweep has one; "
                "give it a value that is the same for all points"
            )


def _print_plan(plan: Sequence[PlannedPoint], selection: Sequence[PlannedPoint]) -> None:
    """A line for each point: whether it would run, its state, identity and name."""
    for planned in plan:
        mark = "run" if planned in selection else ""
        print(f"{mark:4}{planned.state:8}{planned.point.identity[:8]}  {planned.name}")
