"""A Hydra launcher that runs points on the workers of a Dask cluster.

A worker may not start processes by `multiprocessing`, and its threads cannot be stopped; so a job
is a process beside the worker, which ends with the worker and with the command that wants it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from experiments.config.read import ConfigError
from experiments.sweep.cluster import ClusterLauncher, Share

if TYPE_CHECKING:
    from distributed import Client
from experiments.tracking.files import growing, replace_file

# Whoever reaches a scheduler can have it run code, so this one speaks to its own process alone: its
# servers of web pages, which cannot be left out, have no page and are not reached from elsewhere.
_LOOPBACK = "127.0.0.1:0"
_LOCAL = {
    **{"processes": False, "n_workers": 1},
    **{"dashboard_address": _LOOPBACK, "worker_dashboard_address": _LOOPBACK},
}
_NO_PAGES: dict[str, list[str]] = {
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}
_TLS = ("ca_file", "cert", "key")


class DaskLauncher(ClusterLauncher):
    """Jobs on a Dask cluster, one for each thread of its workers at a time.

    Attributes:
        scheduler: address of the cluster, such as tls://host:8786, or None for one in this process.
        tls: files `ca_file`, `cert` and `key` of a cluster that asks for them; None for no others.
    """

    def __init__(
        self,
        jobs: int,
        scheduler: str | None,
        threads: int | None,
        fail_fast: bool,
        tls: Mapping[str, str] | None = None,
    ) -> None:
        super().__init__(jobs, 1, fail_fast)
        self.scheduler, self.tls = scheduler, tls
        self.threads = threads or len(os.sched_getaffinity(0))

    def _check_installed(self) -> None:
        if find_spec("distributed") is None:
            raise ConfigError("hydra/launcher: dask needs distributed: pip install distributed")
        if self.tls is not None and sorted(self.tls) != sorted(_TLS):
            raise ConfigError(f"hydra.launcher.tls: give it {', '.join(_TLS)}, each a file")

    def _run(self, shares: Sequence[Share], folder: Path) -> list[str]:
        from distributed import as_completed  # an extra

        try:
            client = self._client()
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

    def _client(self) -> Client:
        """A connection to the cluster, or to one in this process."""
        import dask
        from distributed import Client
        from distributed.security import Security

        if self.scheduler is None:
            with dask.config.set(_NO_PAGES):
                return Client(None, threads_per_worker=self.threads, **_LOCAL)
        if self.tls is None:
            return Client(self.scheduler)
        files = {
            "tls_ca_file": self.tls["ca_file"],
            "tls_client_cert": self.tls["cert"],
            "tls_client_key": self.tls["key"],
        }
        return Client(self.scheduler, security=Security(require_encryption=True, **files))


def _run_process(index: int, share: Sequence[object], mark: Path, folder: Path) -> None:
    """In a worker: run a share in a process of its own, which ends when the mark is gone."""
    order = {"parent": os.getpid(), "while_exists": str(mark), "share": share, "workers": 1}
    with growing(mark.with_name(f"{index}.log")) as log:
        subprocess.run(
            [sys.executable, "-P", "-m", "experiments.sweep.cluster"],
            input=json.dumps(order).encode(),
            stdout=log,
            stderr=log,
            cwd=folder,
            check=False,
        )
