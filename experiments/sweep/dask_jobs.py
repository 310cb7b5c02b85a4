"""A Hydra launcher that runs points on the workers of a Dask cluster.

A worker may not start processes by `multiprocessing`, and its threads cannot be stopped; so a job
is a process beside the worker, which ends with the worker and with the command that wants it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from tqdm import tqdm

from experiments.config.read import ConfigError
from experiments.sweep.cluster import ClusterLauncher, Share
from experiments.tracking.files import growing, replace_file

_LOCAL = {"processes": False, "n_workers": 1, "dashboard_address": None}


class DaskLauncher(ClusterLauncher):
    """Jobs on a Dask cluster, one for each thread of its workers at a time.

    Attributes:
        scheduler: address of the cluster, such as tcp://host:8786, or None for one in this process.
    """

    def __init__(
        self, jobs: int, scheduler: str | None, threads: int | None, fail_fast: bool
    ) -> None:
        super().__init__(jobs, 1, fail_fast)
        self.scheduler = scheduler
        self.threads = threads or len(os.sched_getaffinity(0))

    def _check_installed(self) -> None:
        if find_spec("distributed") is None:
            raise ConfigError("hydra/launcher: dask needs pip install 'mlci[dask]'")

    def _run(self, shares: Sequence[Share], folder: Path) -> list[str]:
        from distributed import Client, as_completed  # an extra

        local = {} if self.scheduler else {**_LOCAL, "threads_per_worker": self.threads}
        try:
            client = Client(self.scheduler, **local)
        except OSError as error:
            message = f"hydra.launcher.scheduler: {self.scheduler} does not answer: {error}"
            raise ConfigError(message) from None
        mark = folder / "running"
        replace_file(mark, b"")
        try:
            jobs = [
                client.submit(_run_process, i, list(share.items()), mark, Path.cwd(), pure=False)
                for i, share in enumerate(shares)
            ]
            print(f"{len(jobs)} Dask jobs: {folder}", flush=True)
            for _ in tqdm(as_completed(jobs), total=len(jobs), unit="job", disable=None):
                continue
            errors = [job.exception() if job.status == "error" else None for job in jobs]
        finally:
            mark.unlink()  # jobs that still run end
            client.cancel(jobs)
            client.close()
        # KilledWorker, for one, whose own words are of no use.
        ends = [f", {type(error).__name__}" if error else "" for error in errors]
        return [f"Dask job {i}{end}" for i, end in enumerate(ends)]


def _run_process(index: int, share: Sequence[object], mark: Path, folder: Path) -> None:
    """In a worker: run a share in a process of its own, which ends when the mark is gone."""
    order = {"parent": os.getpid(), "while_exists": str(mark), "share": share, "workers": 1}
    with growing(mark.with_name(f"{index}.log")) as log:
        subprocess.run(
            [sys.executable, "-m", "experiments.sweep.cluster"],
            input=json.dumps(order).encode(),
            stdout=log,
            stderr=log,
            cwd=folder,
            check=False,
        )
