"""What engines of several machines share: points dealt to jobs, each of which can fail alone.

A job runs its share of the points in worker processes, as on one machine. What became of a point is
read from what the point left: a job's own account would be a pickle, and none is left of a job that
was killed.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.core.utils import JobReturn, JobStatus
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig

from experiments.config.paths import results_folder
from experiments.config.read import ConfigError, read_config
from experiments.sweep.attempts import bury
from experiments.sweep.pool import Job, PoolLauncher, end_when
from experiments.sweep.worker import run_task
from experiments.tracking.points import Point
from experiments.tracking.trees import plain

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
        points = {job: _point(tree) for job, tree in trees.items()}
        before = {
            job: point.attempts() if trees[job]["sweep"]["force"] else 0
            for job, point in points.items()
        }
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
                told = f"{where[job]}: no result; its log is in {folder}"
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
    points = {job: _point(tree) for job, tree in share.items()}
    before = {job: point.attempts() for job, point in points.items()}
    for job, returned in zip(share, pool.launch(list(share), initial_job_idx=0), strict=True):
        # Nobody but this job knows how a process ended.
        if returned.status is JobStatus.FAILED and not points[job].is_done(before[job]):
            bury(points[job], returned._return_value, before[job])


def _point(tree: Mapping[str, Any]) -> Point:
    """The point of a resolved config."""
    settings, study = read_config(tree)
    return Point.planned(plain(settings), results_folder(study))


def _main() -> None:
    """A job as a process of its own, told on standard input what to run."""
    told = json.load(sys.stdin)
    end_when(lambda: os.getppid() != told["parent"] or not Path(told["while"]).exists())
    run_share({tuple(job): tree for job, tree in told["share"]}, told["workers"])


if __name__ == "__main__":
    _main()
