"""Configs of the project, composed for the benchmark."""

from __future__ import annotations

from hydra import compose, initialize_config_dir

from experiments import run
from experiments.config import read_config
from experiments.places import CONF
from experiments.settings import Settings
from experiments.task import plain_tree


def composed(*words: str) -> Settings:
    """The settings of one point."""
    run.register_plugins()
    with initialize_config_dir(str(CONF), **run.VERSION_BASE):
        return read_config(plain_tree(compose("config", list(words))))[0]


def telescope() -> Settings:
    """The telescoping pendulum as it is configured, at the paper's size."""
    return composed("truth=pain")
