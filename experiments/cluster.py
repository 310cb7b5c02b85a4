"""What engines of several machines share: points dealt to jobs, each of which can fail alone.

A job runs its share of the points in worker processes, as on one machine. What became of a point is
read from what the point left: a job's own account would be a pickle, and none is left of a job that
was killed.
"""

from __future__ import annotations

import tempfile
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.core.utils import JobReturn, JobStatus
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig

from experiments.config import ConfigError, read_config
from experiments.launcher import Job, PoolLauncher
from experiments.record import Point
from experiments.task import results_folder, run_task

Share = Mapping[Job, dict[str, Any]]  # resolved configs by the overrides that made them


class ClusterLauncher(PoolLauncher):
    """Jobs elsewhere; results and code lie on a file system that all machines share.

    Attributes:
        jobs: at most so many jobs; each takes an equal share of the points.
    """

    def __init__(self, jobs: int, workers: int, fail_fast: bool) -> None:
        super().__init__(workers, fail_fast)
        self.jobs = jobs

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        """Look for what jobs need.

        Raises:
            ConfigError: something is not installed, or an option makes no sense.
        """
        super().setup(hydra_context=hydra_context, task_function=task_function, config=config)
        if self.fail_fast:
            raise ConfigError("sweep.fail_fast: a cluster starts jobs by itself; leave it out")
        self._look()

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run all points in jobs; those that were not finished are returned as failed.

        Raises:
            ConfigError: the engine refuses such jobs.
        """
        trees = {tuple(job): self._tree(tuple(job)) for job in job_overrides}
        points, before = {}, {}
        for job, tree in trees.items():
            settings, study = read_config(tree)
            points[job] = Point(settings, results_folder(study))
            before[job] = points[job].attempts() if study.sweep.force else 0
        logs = next(iter(points.values())).results / ".jobs"
        logs.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix="", dir=logs))
        dealt = list(trees)
        shares = [dealt[i :: self.jobs] for i in range(min(self.jobs, len(dealt)))]
        names = self._run([{job: trees[job] for job in share} for share in shares], folder)
        where = {job: name for name, share in zip(names, shares, strict=True) for job in share}
        returns = [JobReturn(overrides=list(job)) for job in points]
        for returned, (job, point) in zip(returns, points.items(), strict=True):
            if point.is_done(before[job]) or point.is_running():  # in another sweep
                returned.status, returned.return_value = JobStatus.COMPLETED, point.state()
            else:
                told = f"{where[job]} ended without a result; its log is in {folder}"
                returned.status, returned.return_value = JobStatus.FAILED, RuntimeError(told)
        return returns

    @abstractmethod
    def _look(self) -> None:
        """Raise a ConfigError unless the engine is there."""

    @abstractmethod
    def _run(self, shares: Sequence[Share], folder: Path) -> list[str]:
        """See each share to the end of its job, whose log goes to a folder; returns jobs' names."""


def run_share(share: Share, workers: int) -> None:
    """In a job: run points in worker processes; each keeps its own result or failure."""
    pool = PoolLauncher(workers, fail_fast=False)
    pool.task, pool.composed = run_task, share
    pool.launch(list(share), initial_job_idx=0)
