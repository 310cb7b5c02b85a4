"""A real point that takes a tenth of a second, and configs as commands compose them."""

import copy
import dataclasses
import functools
from pathlib import Path
from typing import Any

from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.types import RunMode

from experiments.app import version_base
from experiments.config.command_line import quote_options
from experiments.config.paths import CONF
from experiments.config.settings import Settings
from experiments.sweep import attempt
from experiments.sweep.composer import Composer
from experiments.sweep.plugins import register_plugins
from experiments.tracking.points import Point
from experiments.tracking.trees import plain

TINY = (
    "truth=wall",
    "horizon=2.0",
    "dt=0.5",
    "actions=3",
    "grid.shape=[12,8]",
    "safety.shape=[41,21]",
    "demonstrations.pairs=6",
    "demonstrations.keep=3",
    "demonstrations.restarts=1",
    "demonstrations.dt=0.05",
    "ranks.demonstrations=2",
    "ranks.subsets=3",
    "rollouts=1",
    "inference.calibrate=false",
)


def composed(*overrides: str, name: str = "config") -> dict[str, Any]:
    """A config as a command composes it, resolved."""
    return copy.deepcopy(_composed(*overrides, name=name))


@functools.cache  # most tests begin with the same config
def _composed(*overrides: str, name: str) -> dict[str, Any]:
    words = [quote_options(word) for word in overrides]
    # A study's part of Hydra has to be there before its points are composed.
    return _composer(name, *(word for word in words if word.startswith("experiment="))).tree(words)


@functools.cache  # Hydra takes a tenth of a second for each choice of groups
def _composer(name: str, *study: str) -> Composer:
    register_plugins()
    with initialize_config_dir(str(CONF), **version_base()):
        loader = GlobalHydra.instance().config_loader()
        return Composer(loader, loader.load_configuration(name, [*study], RunMode.MULTIRUN))


def planned(settings: Settings, results: Path) -> Point:
    """The point of some settings."""
    return Point.planned(plain(settings), results)


def computed(settings: Settings, results: Path, *, force: bool = False) -> Point:
    """The point of some settings, run here."""
    point = planned(settings, results)
    attempt.run_here(point, settings, print, force=force)
    return point


def hopeless(settings: Settings) -> Settings:
    """The same point with a goal that no demonstration meets: it raises when it runs."""
    strict = dataclasses.replace(settings.demonstrations, goal_tolerance=1e-12)
    return dataclasses.replace(settings, demonstrations=strict)
