"""What runs for one composed config, in this process or in a worker."""

from __future__ import annotations

from typing import Any

from omegaconf import DictConfig

from experiments.config.read import ConfigError, plain_tree, writable_results
from experiments.progress import steps_shown
from experiments.sweep import attempt
from experiments.sweep.plan import read_point
from experiments.tracking.files import read_file
from experiments.tracking.points import State

_SWEEP_ONLY = ("only", "limit", "time_limit", "retries", "fail_fast", "mix_sources", "replace")


def run_single(tree: dict[str, Any]) -> None:
    """Run the point of a resolved config, unless it is finished; prints its log either way.

    Raises:
        ConfigError: the config cannot be run.
    """
    point, settings, study = read_point(tree)
    for option in _SWEEP_ONLY:
        if getattr(study.sweep, option):
            raise ConfigError(f"sweep.{option}: only a sweep heeds it; add -m, or leave it out")
    if study.sweep.dry_run:
        print(f"{point.state()}: {point.folder}")
    elif point.is_done() and not study.sweep.force:
        print(read_file(point.folder / "log.txt").decode(errors="replace"), end="")
        print(f"finished before: {point.folder}")
    else:
        writable_results(study, "points")
        if point.is_running():
            print(f"another process runs this point, and is waited for: {point.folder}")
        with steps_shown():
            attempt.run_here(point, settings, print, force=study.sweep.force)
        print(f"written: {point.folder}")


def run_task(config: DictConfig) -> State:
    """Run one point of a sweep, in a process of any launcher's.

    Returns:
        State.DONE, or State.RUNNING if another process runs it.
    """
    point, settings, study = read_point(plain_tree(config))
    return attempt.run_in_worker(
        point, settings, force=study.sweep.force, time_limit=study.sweep.time_limit
    )
