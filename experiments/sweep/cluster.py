"""What launchers for several machines share: points dealt to jobs, each of which can fail alone.

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

from experiments.config.read import ConfigError
from experiments.sweep.attempt import record_death
from experiments.sweep.plan import Job, read_point
from experiments.sweep.pool import PoolLauncher, end_process_when
from experiments.sweep.worker import run_task

Share = Mapping[Job, dict[str, Any]]  # resolved configs by the overrides that made them


class ClusterLauncher(PoolLauncher):
    """Jobs on other machines, all of which see results and code on a shared file system.

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
        self._check_installed()

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run all points in jobs; those that were not finished are returned as failed.

        Raises:
            ConfigError: the cluster refuses such jobs.
        """
        trees = {tuple(job): self.composed[tuple(job)] for job in job_overrides}
        points = {job: read_point(tree)[0] for job, tree in trees.items()}
        attempts_before = {
            job: point.attempts() if trees[job]["sweep"]["force"] else 0
            for job, point in points.items()
        }
        logs = next(iter(points.values())).results / ".jobs"
        logs.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix="", dir=logs))
        overrides = list(trees)
        shares = [overrides[i :: self.jobs] for i in range(min(self.jobs, len(overrides)))]
        names = self._run([{job: trees[job] for job in share} for share in shares], folder)
        job_name = {job: name for name, share in zip(names, shares, strict=True) for job in share}
        returns = [JobReturn(overrides=list(job)) for job in points]
        for returned, (job, point) in zip(returns, points.items(), strict=True):
            if point.is_done(attempts_before[job]) or point.is_running():  # in another sweep
                returned.status, returned.return_value = JobStatus.COMPLETED, point.state()
            else:
                message = f"{job_name[job]}: no result; its log is in {folder}"
                returned.status, returned.return_value = JobStatus.FAILED, RuntimeError(message)
        return returns

    @abstractmethod
    def _check_installed(self) -> None:
        """Raise a ConfigError unless the cluster's software is there."""

    @abstractmethod
    def _run(self, shares: Sequence[Share], folder: Path) -> list[str]:
        """Run each share in a job until all have ended; returns the jobs' names.

        Args:
            shares: of the points.
            folder: for the jobs' logs.
        """


def run_share(share: Share, workers: int) -> None:
    """In a job: run points in worker processes; each writes its own result or failure."""
    pool = PoolLauncher(workers, fail_fast=False)
    pool.task, pool.composed = run_task, share
    points = {job: read_point(tree)[0] for job, tree in share.items()}
    attempts_before = {job: point.attempts() for job, point in points.items()}
    for job, returned in zip(share, pool.launch(list(share), initial_job_idx=0), strict=True):
        # Nobody but this job knows how a process ended.
        if returned.status is JobStatus.FAILED and not points[job].is_done(attempts_before[job]):
            record_death(points[job], returned._return_value, attempts_before[job])


def _main() -> None:
    """A job as a process of its own, which reads on standard input what to run."""
    order = json.load(sys.stdin)
    end_process_when(
        lambda: os.getppid() != order["parent"] or not Path(order["while_exists"]).exists()
    )
    run_share({tuple(job): tree for job, tree in order["share"]}, order["workers"])


if __name__ == "__main__":
    _main()
