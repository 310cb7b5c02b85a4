"""A real point that takes a tenth of a second, for tests of what is kept of points."""

import dataclasses
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from hydra import compose, initialize_config_dir

from experiments import run
from experiments.config import read_config
from experiments.places import CONF
from experiments.settings import Settings
from experiments.task import plain_tree

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
)


@pytest.fixture(autouse=True)
def _figures_are_closed() -> Iterator[None]:
    """What a test draws does not stay open, where anything draws at all."""
    before = set(_plt().get_fignums()) if _plt() else set()
    yield
    if _plt():
        for number in set(_plt().get_fignums()) - before:
            _plt().close(number)


def _plt() -> Any:
    """matplotlib.pyplot, if some test has imported it."""
    return sys.modules.get("matplotlib.pyplot")


@pytest.fixture(scope="session")
def settings() -> Settings:
    """The double integrator beside a wall, a handful of trials."""
    run.register_plugins()
    with initialize_config_dir(str(CONF), **run.VERSION_BASE):
        return read_config(plain_tree(compose("config", list(TINY))))[0]


def hopeless(settings: Settings) -> Settings:
    """The same point with a goal that no demonstration meets: it raises when it runs."""
    strict = dataclasses.replace(settings.demonstrations, goal_tolerance=1e-12)
    return dataclasses.replace(settings, demonstrations=strict)
