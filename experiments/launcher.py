"""A Hydra launcher that runs points in parallel processes, each of which can fail alone."""

from __future__ import annotations

import contextlib
import io
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Sequence
from concurrent.futures import Future, as_completed
from multiprocessing import resource_tracker
from typing import Any

from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf
from pebble import ProcessPool
from tqdm import tqdm

from experiments.errors import job_names
from experiments.task import plain_tree

_BAR = "{percentage:3.0f}%|{bar}| {n}/{total} points, {elapsed} gone, {remaining} left{postfix}"


class PoolLauncher(Launcher):
    """Worker processes on this machine.

    Attributes:
        workers: number of processes; None for one a core.
        composed: configs that the sweeper has composed already, by their overrides.
    """

    def __init__(self, workers: int | None) -> None:
        self.workers = workers or len(os.sched_getaffinity(0))
        self.composed: dict[tuple[str, ...], dict[str, Any]] = {}

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        self.context, self.task, self.config = hydra_context, task_function, config

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run all jobs; a failed one is returned with its exception, and stops no other."""
        jobs = [tuple(overrides) for overrides in job_overrides]
        spawn = multiprocessing.get_context("spawn")
        pool = ProcessPool(min(self.workers, len(jobs)), context=spawn)
        resource_tracker.ensure_running()  # its start would unblock the signal
        try:
            # Workers inherit the mask: Ctrl-C reaches this process only, which then stops them.
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
            try:
                futures: dict[Future[Any], tuple[str, ...]] = {
                    pool.schedule(_work, [self.task, self._tree(job)]): job for job in jobs
                }
            finally:
                signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            returns = _collect(futures)
        finally:
            pool.stop()
            pool.join()
        return [returns[job] for job in jobs]

    def _tree(self, job: tuple[str, ...]) -> dict[str, Any]:
        """The resolved config of a job."""
        if job in self.composed:
            return self.composed[job]
        return plain_tree(self.context.config_loader.load_sweep_config(self.config, list(job)))


def _work(task: TaskFunction, tree: dict[str, Any]) -> tuple[Any, float]:
    """In a worker: the task's value and its time; what it prints is in the point's log already."""
    start = time.perf_counter()
    with contextlib.redirect_stdout(io.StringIO()):
        value = task(OmegaConf.create(tree))
    return value, time.perf_counter() - start


def _collect(futures: dict[Future[Any], tuple[str, ...]]) -> dict[tuple[str, ...], JobReturn]:
    """Wait for all jobs and report each: on a bar in a terminal, else on a line."""
    names = dict(zip(futures.values(), job_names(list(futures.values())), strict=True))
    returns: dict[tuple[str, ...], JobReturn] = {}
    failures = 0
    terminal = sys.stderr.isatty()
    with tqdm(total=len(futures), bar_format=_BAR, disable=not terminal) as bar:
        for future in as_completed(futures):
            job = futures[future]
            error = future.exception()
            done = JobReturn(overrides=list(job))
            done.status = JobStatus.FAILED if error else JobStatus.COMPLETED
            done.return_value = error or future.result()[0]
            returns[job] = done
            failures += error is not None
            bar.set_postfix_str(f"{failures} failed" if failures else "")
            bar.update()
            if not terminal:
                took = "FAILED" if error else f"{future.result()[1]:.1f} s"
                print(f"[{len(returns)}/{len(futures)}] {names[job]}: {took}", flush=True)
    return returns
