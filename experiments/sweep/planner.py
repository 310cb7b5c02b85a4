"""A Hydra sweeper that checks every point first, runs those that are missing, then collates."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.core.plugins import Plugins
from hydra.errors import HydraException
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf
from tqdm import tqdm

from experiments.collate.join import collate
from experiments.config.command_line import quote_options
from experiments.config.explain import explain
from experiments.config.paths import results_folder
from experiments.config.read import ConfigError, plain_tree, read_config
from experiments.config.settings import StudySettings, SweepSettings
from experiments.console import job_names
from experiments.sweep.execution import Planned, chosen, count_states, run_points
from experiments.sweep.failures import describe_failures, gather
from experiments.sweep.pool import PoolLauncher
from experiments.sweep.worker import run_task
from experiments.tracking.points import Point, State
from experiments.tracking.study import write_plan
from experiments.tracking.trees import plain


class SweepFailed(Exception):
    """Some points failed; the message tells of each."""


class Planner(Sweeper):
    """All combinations of the swept values, each with every case, as one batch for any launcher.

    Attributes:
        params: values that an experiment sweeps, by key: "1,2,3".
        cases: lists of overrides that go together, such as [actions=9, seed=1]; [] changes nothing.
            Where one of them has several values, so has the case.
        ends: of several values take the first and the last only, and say so.
    """

    def __init__(
        self,
        params: Mapping[str, str] | None = None,
        cases: Sequence[Sequence[str]] | None = None,
        ends: bool = False,
    ) -> None:
        self.params, self.ends = dict(params or {}), ends
        self.cases = cases or [[]]  # what is wrong with them is told when they are read

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        # The task of a single run ends the process when it fails; a sweep's point fails alone.
        self._loader, self._base = hydra_context.config_loader, config
        self._launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=run_task, config=config
        )

    def sweep(self, arguments: list[str]) -> None:
        """Plan, launch and collate.

        Raises:
            ConfigError: some point cannot be run; then none is.
            SweepFailed: some points failed, after all others ran; then no table is written.
        """
        plan, study = self._plan(self._jobs(arguments))
        options, folder = study.sweep, results_folder(study) / study.study
        todo = chosen(plan, options)
        print(f"{len(plan)} points: {count_states(plan)}; {len(todo)} to run", flush=True)
        if options.dry_run:
            selected = set(todo)
            for planned in plan:
                mark = "run" if planned in selected else ""
                print(f"{mark:4}{planned.state:8}{planned.point.identity[:8]}  {planned.name}")
            return
        write_plan(folder, [(each.point, each.job) for each in plan], study.examples)
        outcome = run_points(
            todo, lambda jobs: self._launcher.launch(jobs, initial_job_idx=0), options
        )
        if outcome.failures:
            raise SweepFailed(describe_failures(outcome, len(plan)))
        finished = {*todo, *(each for each in plan if each.state in (State.DONE, State.STALE))}
        if len(finished) < len(plan):
            left = len(plan) - len(finished)
            print(f"{left} of {len(plan)} points are left, and no table is written")
            return
        points = [planned.point for planned in plan]
        for table in collate(points, folder, mixed=options.mix_sources):
            print(f"written: {table}")

    def _jobs(self, arguments: list[str]) -> list[list[str]]:
        """The overrides of every point; the command line wins over the experiment's own."""
        self.cases = _read_cases(self.cases)
        parser = OverridesParser.create(config_loader=self._loader)
        typed = parser.parse_overrides(arguments)
        given = {override.key_or_group for override in typed}
        values: dict[str, list[str]] = {}
        shortened: list[str] = []
        own = [quote_options(f"{key}={swept}") for key, swept in self.params.items()]
        for override in parser.parse_overrides(own):
            _values(override)  # what cannot be swept is refused even where the command line wins
            if override.key_or_group not in given:
                values[override.get_key_element()] = self._own_values(override, shortened)
        for override in typed:
            values[override.get_key_element()] = _values(override)
        cases = [
            list(case)
            for i in range(len(self.cases))
            for case in self._read_case(i, parser, given, shortened)
        ]
        for line in dict.fromkeys(shortened):
            print(line)
        return [[*job, *case] for job in itertools.product(*values.values()) for case in cases]

    def _read_case(
        self, i: int, parser: OverridesParser, given: set[str], shortened: list[str]
    ) -> Iterator[tuple[str, ...]]:
        """The points of a case, without the keys that the command line gives."""
        swept = {word.lstrip("+~") for word in self.params}
        found: dict[str, list[str]] = {}
        for word in self.cases[i]:
            where = f"hydra.sweeper.cases[{i}]: {word}"
            try:
                override = parser.parse_override(quote_options(word))
            except HydraException:
                raise ConfigError(f"{where} cannot be read as key=value") from None
            name = override.key_or_group
            if name in _NOT_SWEPT:
                raise ConfigError(f"{where}: {_NOT_SWEPT[name]}")
            if name in found:
                raise ConfigError(f"{where} is the second value of {name} in this case; keep one")
            if name in swept:
                raise ConfigError(f"{where}: params sweep {name} too; leave it to one of them")
            found[name] = [] if name in given else self._own_values(override, shortened)
        return itertools.product(*(values for name, values in found.items() if name not in given))

    def _own_values(self, override: Override, shortened: list[str]) -> list[str]:
        """What an experiment gives a key, or the ends of it; notes what the ends stand for."""
        each = _values(override)
        if self.ends and len(each) > 2:
            every = ", ".join(override.sweep_string_iterator())
            first, *_, last = override.sweep_string_iterator()
            key = override.get_key_element()
            shortened.append(f"{key}: {first} and {last} stand for all of {every}")
            each = [each[0], each[-1]]
        return each

    def _plan(self, jobs: Sequence[Sequence[str]]) -> tuple[list[Planned], StudySettings]:
        """Compose and check every point; of equal ones the first stays."""
        plan: dict[str, Planned] = {}
        trees: dict[tuple[str, ...], dict[str, Any]] = {}
        problems: dict[str, list[str]] = {}
        bar = tqdm(jobs, desc="checking points", unit="point", leave=False, disable=None)
        for job, name in zip(bar, job_names(jobs), strict=True):
            try:
                tree = plain_tree(self._loader.load_sweep_config(self._base, list(job)))
                settings, study = read_config(tree)
            except Exception as error:
                for line in explain(error).splitlines():
                    problems.setdefault(line, []).append(name)
                continue
            point = Point.planned(plain(settings), results_folder(study))
            if point.identity not in plan:
                plan[point.identity] = Planned(tuple(job), name, point, point.state())
                trees[tuple(job)] = tree
        if problems:
            raise ConfigError(gather(problems, len(jobs)))
        if len(plan) < len(jobs):
            print(f"{len(jobs) - len(plan)} of {len(jobs)} combinations repeat others")
        if isinstance(self._launcher, PoolLauncher):
            self._launcher.names = {planned.job: planned.name for planned in plan.values()}
            self._launcher.composed = trees  # composing costs 0.1 s a point
        return list(plan.values()), study


def _values(override: Override) -> list[str]:
    """The overrides that one with several values stands for."""
    key, name = override.get_key_element(), override.key_or_group
    if not override.is_sweep_override():
        return [f"{key}={override.get_value_element_as_str()}"]
    if name in _NOT_SWEPT:
        raise ConfigError(f"{override.input_line}: {_NOT_SWEPT[name]}")
    if not override.is_discrete_sweep():
        raise ConfigError(f"{override.input_line}: cannot be swept; list its values")
    each = [quote_options(f"{key}={value}") for value in override.sweep_string_iterator()]
    if not each:
        raise ConfigError(f"{override.input_line}: there is no value to sweep")
    return each


def _read_cases(cases: object) -> list[list[str]]:
    """The words of each case, as they were written.

    Raises:
        ConfigError: cases that are not lists of overrides.
    """
    plain = OmegaConf.to_container(cases) if OmegaConf.is_config(cases) else cases
    if not isinstance(plain, list):
        raise ConfigError(f"hydra.sweeper: cases: {plain!r} is no list of lists of overrides")
    for i, case in enumerate(plain):
        if not (isinstance(case, list) and all(isinstance(word, str) for word in case)):
            raise ConfigError(
                f"hydra.sweeper: cases[{i}]: {case!r} is no list of overrides, such as "
                "[dt=0.5, seed=1]"
            )
    return plain


_NOT_SWEPT = {
    "scale": "a sweep has one scale; run it once for each",
    "experiment": "a sweep over experiments would drop the values that each of them sweeps; "
    "run them one after the other",
    **dict.fromkeys(
        ("study", "results", "workers", *(f"sweep.{f.name}" for f in fields(SweepSettings))),
        "this changes no result, so give it one value only",
    ),
}
