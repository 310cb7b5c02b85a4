"""Configs of the project, composed for the benchmark."""

from __future__ import annotations

from hydra import compose, initialize_config_dir

from experiments.app import version_base
from experiments.config.paths import CONF
from experiments.config.read import plain_tree, read_config
from experiments.config.settings import Settings
from experiments.sweep.plugins import register_plugins


def composed(*words: str) -> Settings:
    """The settings of one point."""
    register_plugins()
    with initialize_config_dir(str(CONF), **version_base()):
        return read_config(plain_tree(compose("config", list(words))))[0]


def telescope() -> Settings:
    """The telescoping pendulum as it is configured, at the paper's size."""
    return composed("truth=pain")
