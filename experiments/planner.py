"""A Hydra sweeper that checks every point first, runs those that are missing, then collates."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.plugins import Plugins
from hydra.core.utils import JobStatus
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig
from tqdm import tqdm

from experiments.config import ConfigError, read_config
from experiments.errors import CONF, describe_failures, explain, gather, job_names
from experiments.launcher import PoolLauncher
from experiments.record import Point
from experiments.settings import StudySettings
from experiments.tables import collate
from experiments.task import plain_tree, results_folder, run_task


class SweepFailed(Exception):
    """Some points failed; the message tells of each."""


class Planner(Sweeper):
    """All combinations of the swept values, as one batch for any launcher.

    Attributes:
        params: values that an experiment sweeps, by key: "1,2,3".
    """

    def __init__(self, params: Mapping[str, str] | None = None) -> None:
        self.params = dict(params or {})

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
        points, study = self._plan(self._jobs(arguments))
        missing = [job for job, point in points.items() if not point.is_done()]
        print(f"{len(points)} points: {len(points) - len(missing)} done, {len(missing)} to run")
        returns = self._launcher.launch(missing, initial_job_idx=0) if missing else []
        failed = {
            name: done._return_value
            for name, done in zip(job_names(missing), returns, strict=True)
            if done.status is not JobStatus.COMPLETED
        }
        if failed:
            raise SweepFailed(describe_failures(failed, len(points)))
        for table in collate(list(points.values()), results_folder(study) / study.study):
            print(f"written: {table}")

    def _jobs(self, arguments: list[str]) -> list[list[str]]:
        """The overrides of every point; the command line wins over the experiment's own."""
        parser = OverridesParser.create(config_loader=self._loader)
        values: dict[str, list[str]] = {}
        own = [quote_options(f"{key}={swept}") for key, swept in self.params.items()]
        for override in parser.parse_overrides([*own, *arguments]):
            key, name = override.get_key_element(), override.key_or_group
            if not override.is_sweep_override():
                values[key] = [f"{key}={override.get_value_element_as_str()}"]
            elif name in _NOT_SWEPT:
                raise ConfigError(f"{override.input_line}: {_NOT_SWEPT[name]}")
            elif not override.is_discrete_sweep():
                raise ConfigError(f"{override.input_line}: cannot be swept; list its values")
            else:
                each = override.sweep_string_iterator()
                values[key] = [quote_options(f"{key}={value}") for value in each]
        return [list(job) for job in itertools.product(*values.values())]

    def _plan(
        self, jobs: Sequence[Sequence[str]]
    ) -> tuple[dict[tuple[str, ...], Point], StudySettings]:
        """Compose and check every point; of equal ones the first stays."""
        points: dict[str, tuple[tuple[str, ...], Point]] = {}
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
            point = Point(settings, results_folder(study))
            points.setdefault(point.identity, (tuple(job), point))
            trees[tuple(job)] = tree
        if problems:
            raise ConfigError(gather(problems, len(jobs)))
        if len(points) < len(jobs):
            print(f"{len(jobs) - len(points)} of {len(jobs)} combinations repeat others")
        if isinstance(self._launcher, PoolLauncher):
            self._launcher.composed = trees  # composing costs 0.2 s a point
        return dict(points.values()), study


def quote_options(argument: str) -> str:
    """grid=100,400 as grid='100','400': Hydra takes a bare number for a value, not an option."""
    key, _, values = argument.partition("=")
    if not re.fullmatch(r"\d+(,\d+)*", values) or not (CONF / key).is_dir():
        return argument
    return key + "=" + ",".join(f"'{value}'" for value in values.split(","))


_NOT_SWEPT = {
    "experiment": "a sweep over experiments would drop the values that each of them sweeps; "
    "run them one after the other",
    **dict.fromkeys(
        ("study", "results", "workers"), "this changes no result, so give it one value only"
    ),
}
