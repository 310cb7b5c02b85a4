"""A Hydra launcher that runs points in parallel processes, each of which can fail alone."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from itertools import islice
from multiprocessing import resource_tracker
from typing import Any, NoReturn

from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf
from pebble import ProcessExpired, ProcessPool
from tqdm import tqdm

from experiments.sweep.plan import Job

_BAR = "{percentage:3.0f}%|{bar:20}| {n}/{total} points, {elapsed} gone, {remaining} left{postfix}"
_REFRESH = 0.5  # [s]
_GRACE = 5.0  # [s] after its time limit in which a worker may end by itself


class PoolLauncher(Launcher):
    """Worker processes on this machine.

    Attributes:
        workers: number of processes; None for one a core.
        fail_fast: start no job after one has failed.
        names: what the sweeper calls jobs, by their overrides.
        composed: configs that the sweeper has composed, by their overrides.
    """

    def __init__(self, workers: int | None, fail_fast: bool) -> None:
        self.workers = workers or len(os.sched_getaffinity(0))
        self.fail_fast = fail_fast
        self.names: Mapping[Job, str] = {}
        self.composed: Mapping[Job, dict[str, Any]] = {}

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        self.task = task_function

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run all jobs; a failed one is returned with its exception, and stops no other.

        Each is reported when it ends: on a bar in a terminal, else on a line.
        """
        jobs = [tuple(overrides) for overrides in job_overrides]
        returns = {job: JobReturn(overrides=list(job)) for job in jobs}  # UNKNOWN until it ran
        terminal = sys.stderr.isatty()
        bar = tqdm(total=len(jobs), bar_format=_BAR, disable=not terminal)
        others = set(multiprocessing.active_children())
        pool = ProcessPool(
            min(self.workers, len(jobs)),
            context=multiprocessing.get_context("spawn"),
            initializer=_end_with_parent,
            initargs=[os.getpid()],
        )
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
        resource_tracker.ensure_running()  # its start would unblock SIGINT
        waiting, ended, failures = iter(jobs), 0, 0
        running: dict[Future[Any], Job] = {}
        try:
            # Processes inherit the mask: signals reach this one only, which then stops them.
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                for job in islice(waiting, self.workers):
                    running[self._schedule(pool, job)] = job
            finally:
                signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGHUP})
            while running:
                self._update(bar, failures, running.values())
                for future in wait(running, _REFRESH, FIRST_COMPLETED).done:
                    job = running.pop(future)
                    returned = returns[job]
                    if error := _error_of(future):
                        returned.status, returned.return_value = JobStatus.FAILED, error
                        end = "FAILED"
                    else:
                        returned.status = JobStatus.COMPLETED
                        returned.return_value, seconds = future.result()
                        end = f"{returned.return_value}, {seconds:.1f} s"
                    ended += 1
                    failures += error is not None
                    bar.update()
                    if not terminal:
                        print(f"[{ended}/{len(jobs)}] {self._name(job)}: {end}", flush=True)
                    if not (self.fail_fast and failures):
                        for job in islice(waiting, 1):
                            running[self._schedule(pool, job)] = job
            self._update(bar, failures, [])
        finally:
            pool.stop()
            # The pool closes its locks before its workers; one that still starts would complain.
            for worker in set(multiprocessing.active_children()) - others:
                worker.kill()
            pool.join()
            bar.close()
        return [returns[job] for job in jobs]

    def _schedule(self, pool: ProcessPool, job: Job) -> Future[Any]:
        """Hand a job to a worker, which is killed if it is still there well after its time limit.

        It ends itself at the limit, and tells where it was; but not if it was stopped (SIGSTOP).
        """
        tree = self.composed[job]
        limit = tree.get("sweep", {}).get("time_limit")
        future: Future[Any] = pool.schedule(
            _work, [self.task, tree], timeout=None if limit is None else limit + _GRACE
        )
        return future

    def _update(self, bar: tqdm[NoReturn], failures: int, running: Iterable[Job]) -> None:
        """Write the number of failures, and what runs now, at the end of the bar."""
        count = [f"{failures} failed"] if failures else []
        bar.set_postfix_str(" | ".join([*count, *map(self._name, running)]))

    def _name(self, job: Job) -> str:
        """What tells a job from the others."""
        return self.names.get(job) or " ".join(job)


def end_process_when(needless: Callable[[], bool]) -> None:
    """End this process, from a thread, once it is not needed any more."""

    def watch() -> None:
        while not needless():
            time.sleep(0.2)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _end_with_parent(parent: int) -> None:
    """In a worker: end when the process that started it has ended, however that was killed."""
    end_process_when(lambda: os.getppid() != parent)


def _error_of(future: Future[Any]) -> BaseException | None:
    """The error of a job, or None."""
    error = future.exception()
    if isinstance(error, ProcessExpired):
        code = error.exitcode
        end = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with {code}"
        return ChildProcessError(f"the worker process {end}")
    if isinstance(error, TimeoutError):
        return TimeoutError("still running at its time limit; its process was stopped, or stuck")
    return error


def _work(task: TaskFunction, tree: dict[str, Any]) -> tuple[Any, float]:
    """In a worker: the task's value and its time."""
    start = time.perf_counter()
    return task(OmegaConf.create(tree)), time.perf_counter() - start
