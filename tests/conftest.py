"""A real point that takes a tenth of a second, for tests of what is kept of points."""

import gc
import os
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from tiny_point import TINY, composed

from experiments.config.quick_yaml import read_yaml_in_c
from experiments.config.read import read_config
from experiments.config.settings import Settings

# Bytecode is kept even where the environment says otherwise: dozens of processes that tests start
# would each compile all modules again, for two seconds.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_collection_finish() -> None:
    """As in our commands: YAML is read in C, and garbage looked for seldom, not in what is here."""
    read_yaml_in_c()
    gc.set_threshold(50_000)
    gc.freeze()


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
    return read_config(composed(*TINY))[0]
