"""What runs for one composed config, in this process or in a worker."""

from __future__ import annotations

from omegaconf import DictConfig

from experiments.config.paths import results_folder
from experiments.config.read import ConfigError, plain_tree, read_config
from experiments.sweep import attempts as attempt
from experiments.tracking.points import Point, State
from experiments.tracking.trees import plain


def run_once(config: DictConfig) -> None:
    """Run the point of a composed config, unless it is finished; prints its log either way.

    Raises:
        ConfigError: the config cannot be run.
    """
    settings, study = read_config(plain_tree(config))
    for option in ("only", "limit", "time_limit", "retries", "fail_fast", "mix_sources"):
        if getattr(study.sweep, option):
            raise ConfigError(f"sweep.{option}: only a sweep heeds it; add -m, or leave it out")
    point = Point.planned(plain(settings), results_folder(study))
    if study.sweep.dry_run:
        print(f"{point.state()}: {point.folder}")
    elif point.is_done() and not study.sweep.force:
        print((point.folder / "log.txt").read_text(), end="")
        print(f"finished before: {point.folder}")
    else:
        if point.is_running():
            print(f"another process runs this point, and is waited for: {point.folder}")
        attempt.run(point, settings, print, force=study.sweep.force)
        print(f"written: {point.folder}")


def run_task(config: DictConfig) -> State:
    """Run one point of a sweep, in a process of any launcher's.

    Returns:
        State.DONE, or State.RUNNING if somebody else runs it.
    """
    settings, study = read_config(plain_tree(config))
    point = Point.planned(plain(settings), results_folder(study))
    return attempt.run_apart(
        point, settings, force=study.sweep.force, time_limit=study.sweep.time_limit
    )
