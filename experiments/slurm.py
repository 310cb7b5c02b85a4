"""A Hydra launcher that runs points as SLURM jobs, each of which can fail alone.

A job runs its share of the points in worker processes, as on one machine. What became of a point is
read from what the point left, and whether a job has ended from `squeue`: a job's own account would
be a pickle, and none is left of a job that was killed.
"""

from __future__ import annotations

import getpass
import shutil
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hydra.core.utils import JobReturn, JobStatus
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig
from tqdm import tqdm

from experiments.config import ConfigError, read_config
from experiments.launcher import Job, PoolLauncher
from experiments.record import Point, State
from experiments.task import results_folder, run_task

_PATIENCE = 3  # looks at the queue in which a job must be absent before it counts as ended
_SUBMISSION = {  # what submitit calls our own options
    "partition": "slurm_partition",
    "array_parallelism": "slurm_array_parallelism",
    "setup": "slurm_setup",
    "additional_parameters": "slurm_additional_parameters",
}


class SlurmLauncher(PoolLauncher):
    """Jobs of one SLURM array; results and code lie on a file system that all nodes share.

    Attributes:
        jobs: at most so many jobs; each takes an equal share of the points.
        poll: [s] between looks at the queue.
        resources: what a job asks for: `timeout_min`, `cpus_per_task`, `mem_gb`, `partition`,
            `array_parallelism` and the like; None is the cluster's own default.
    """

    def __init__(self, jobs: int, poll: float, fail_fast: bool, **resources: Any) -> None:
        super().__init__(resources["cpus_per_task"], fail_fast)
        self.jobs, self.poll = jobs, poll
        self.resources = {
            _SUBMISSION.get(key, key): value
            for key, value in resources.items()
            if value is not None
        }

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        """Look for what jobs need.

        Raises:
            ConfigError: submitit or SLURM is not installed, or an option makes no sense.
        """
        super().setup(hydra_context=hydra_context, task_function=task_function, config=config)
        if self.fail_fast:
            raise ConfigError("sweep.fail_fast: a cluster starts jobs by itself; leave it out")
        if find_spec("submitit") is None:
            raise ConfigError("hydra/launcher: slurm needs pip install 'mlci[slurm]'")
        if shutil.which("sbatch") is None:
            raise ConfigError("hydra/launcher: slurm needs sbatch, which is not on this machine")

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run all points in jobs; those that were not finished are returned as failed.

        Raises:
            ConfigError: SLURM refuses such jobs.
        """
        trees = {tuple(job): self._tree(tuple(job)) for job in job_overrides}
        points = {job: _point(tree) for job, tree in trees.items()}
        results = next(iter(points.values())).results
        (results / ".slurm").mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix="", dir=results / ".slurm"))
        dealt = list(trees)
        shares = [dealt[i :: self.jobs] for i in range(min(self.jobs, len(dealt)))]
        ids = self._submit([{job: trees[job] for job in share} for share in shares], folder)
        try:
            self._wait(ids)
        finally:
            subprocess.run(["scancel", *{each.partition("_")[0] for each in ids}], check=False)
            for pickled in folder.glob("*.pkl"):
                pickled.unlink()
        where = {job: each for each, share in zip(ids, shares, strict=True) for job in share}
        return [_returned(job, points[job], where[job], folder) for job in trees]

    def _submit(self, shares: Sequence[Mapping[Job, Any]], folder: Path) -> list[str]:
        """Hand the shares to SLURM; returns each one's job id, such as 12_3."""
        import submitit  # an extra

        executor = submitit.AutoExecutor(folder, cluster="slurm")
        executor.update_parameters(name="mlci", **self.resources)
        try:
            jobs = executor.map_array(_run_share, shares, [self.workers] * len(shares))
        except submitit.core.utils.FailedJobError as error:
            raise ConfigError(f"hydra/launcher: SLURM refused the jobs: {error}") from None
        print(
            f"{len(jobs)} SLURM jobs, {jobs[0].job_id} to {jobs[-1].job_id}: {folder}", flush=True
        )
        return [job.job_id for job in jobs]

    def _wait(self, ids: Sequence[str]) -> None:
        """Until no job is in the queue any more; looks at no file, of which there may be many."""
        absent = dict.fromkeys(ids, 0)
        with tqdm(total=len(ids), unit="job", disable=None) as bar:
            while min(absent.values()) < _PATIENCE:
                time.sleep(self.poll)
                queue = _queue()
                if queue is None:
                    continue
                absent = {each: 0 if each in queue else n + 1 for each, n in absent.items()}
                ended = sum(n >= _PATIENCE for n in absent.values())
                if bar.disable and ended > bar.n:
                    print(f"[{ended}/{len(ids)}] jobs ended", flush=True)
                bar.n = ended
                bar.refresh()


def _run_share(share: Mapping[Job, dict[str, Any]], workers: int) -> None:
    """In a SLURM job: run points in worker processes; each keeps its own result or failure."""
    pool = PoolLauncher(workers, fail_fast=False)
    pool.task, pool.composed = run_task, dict(share)
    pool.launch(list(share), initial_job_idx=0)


def _point(tree: Mapping[str, Any]) -> Point:
    """The point of a resolved config."""
    settings, study = read_config(tree)
    return Point(settings, results_folder(study))


def _queue() -> set[str] | None:
    """Ids of this user's jobs that wait or run; None if SLURM does not answer now."""
    command = ["squeue", "--noheader", "--array", "--format=%i", f"--user={getpass.getuser()}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return set(done.stdout.split()) if done.returncode == 0 else None


def _returned(job: Job, point: Point, job_id: str, folder: Path) -> JobReturn:
    """What became of a point whose job has ended."""
    returned = JobReturn(overrides=list(job))
    state = point.state()
    if state in (State.DONE, State.RUNNING):  # running in another sweep
        returned.status, returned.return_value = JobStatus.COMPLETED, state
    else:
        message = f"SLURM job {job_id} ended without a result; its log is in {folder}"
        returned.status, returned.return_value = JobStatus.FAILED, RuntimeError(message)
    return returned
