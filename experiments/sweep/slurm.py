"""A Hydra launcher that runs points as SLURM jobs.

Whether a job has ended is read from `squeue`, so that no accounting is needed.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from tqdm import tqdm

from experiments.config.read import ConfigError
from experiments.sweep.cluster import ClusterLauncher, Share, run_share

_ANSWER = 60.0  # [s] that squeue may take
_SILENCE = 3600.0  # [s] without an answer of squeue after which it is asked no more
_PATIENCE = 3  # looks at the queue in which a job must be absent before it counts as ended
_SUBMISSION = {  # what submitit calls our own options
    "partition": "slurm_partition",
    "array_parallelism": "slurm_array_parallelism",
    "setup": "slurm_setup",
    "additional_parameters": "slurm_additional_parameters",
}


class SlurmLauncher(ClusterLauncher):
    """Jobs of one SLURM array.

    Attributes:
        poll: [s] between looks at the queue.
        resources: what a job asks for: `timeout_min`, `cpus_per_task`, `mem_gb`, `partition`,
            `array_parallelism` and the like; None is the cluster's own default.
    """

    def __init__(self, jobs: int, poll: float, fail_fast: bool, **resources: Any) -> None:
        super().__init__(jobs, resources["cpus_per_task"], fail_fast)
        self.poll = poll
        self.resources = {
            _SUBMISSION.get(key, key): value
            for key, value in resources.items()
            if value is not None
        }

    def _check_installed(self) -> None:
        if find_spec("submitit") is None:
            raise ConfigError("hydra/launcher: slurm needs submitit: pip install submitit")
        if shutil.which("sbatch") is None:
            raise ConfigError("hydra/launcher: slurm needs sbatch, which is not on this machine")

    def _run(self, shares: Sequence[Share], folder: Path) -> list[str]:
        ids = self._submit(shares, folder)
        try:
            self._wait(ids)
        finally:
            _cancel(ids)
            for pickled in folder.glob("*.pkl"):
                pickled.unlink()
        return [f"SLURM job {job_id}" for job_id in ids]

    def _submit(self, shares: Sequence[Share], folder: Path) -> list[str]:
        """Hand the shares to SLURM; returns each one's job id, such as 12_3."""
        import submitit  # an extra

        python = f"{shlex.quote(sys.executable)} -P"  # the current folder is no place for modules
        executor = submitit.AutoExecutor(folder, cluster="slurm", slurm_python=python)
        executor.update_parameters(name="mlci", **self.resources)
        try:
            jobs = executor.map_array(run_share, shares, [self.workers] * len(shares))
        except submitit.core.utils.FailedJobError as error:
            raise ConfigError(f"hydra/launcher: SLURM refused the jobs: {error}") from None
        print(
            f"{len(jobs)} SLURM jobs, {jobs[0].job_id} to {jobs[-1].job_id}: {folder}", flush=True
        )
        return [job.job_id for job in jobs]

    def _wait(self, ids: Sequence[str]) -> None:
        """Until no job is in the queue any more, or `squeue` has been silent for too long.

        It looks at no file, of which there may be many.
        """
        absent, silent, answered = dict.fromkeys(ids, 0), False, time.monotonic()
        with tqdm(total=len(ids), unit="job", disable=None) as bar:
            while min(absent.values()) < _PATIENCE:
                time.sleep(self.poll)
                queue = _queue(ids)
                if queue is None:
                    if not silent:
                        print("squeue does not answer; it is asked again", flush=True)
                    silent = True
                    if time.monotonic() - answered > _SILENCE:
                        print(f"squeue was silent for {_SILENCE:g} s; the jobs are cancelled")
                        return
                    continue
                silent, answered = False, time.monotonic()
                absent = {job_id: 0 if job_id in queue else n + 1 for job_id, n in absent.items()}
                ended = sum(n >= _PATIENCE for n in absent.values())
                if bar.disable and ended > bar.n:
                    print(f"[{ended}/{len(ids)}] jobs ended", flush=True)
                bar.n = ended
                bar.refresh()


def _cancel(ids: Sequence[str]) -> None:
    """Cancel the arrays of some jobs, if SLURM answers."""
    arrays = sorted({job_id.partition("_")[0] for job_id in ids})
    try:
        subprocess.run(["scancel", *arrays], check=False, timeout=_ANSWER)
    except subprocess.TimeoutExpired:
        print(f"scancel does not answer; cancel by hand: scancel {' '.join(arrays)}", flush=True)


def _queue(ids: Sequence[str]) -> set[str] | None:
    """Those of some jobs that wait or run; None if SLURM does not answer."""
    arrays = ",".join(sorted({job_id.partition("_")[0] for job_id in ids}))
    command = ["squeue", "--noheader", "--array", "--format=%i", f"--jobs={arrays}"]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=_ANSWER)
    except subprocess.TimeoutExpired:
        return None
    if "Invalid job id" in answer.stderr:  # all have ended, and are forgotten
        return set()
    return set(answer.stdout.split()) if answer.returncode == 0 else None
