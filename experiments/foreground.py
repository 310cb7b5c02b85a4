"""A command that composes one config of its own and acts on it here and now."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

import hydra
from omegaconf import DictConfig

from experiments.config import ConfigError
from experiments.errors import explain
from experiments.own_folder import command_words
from experiments.places import CONF
from experiments.run import DONE, REFUSED, STOPPED, VERSION_BASE
from experiments.task import plain_tree


def run_command(config_name: str, act: Callable[[dict[str, Any]], int]) -> int:
    """Compose a config from the command line, and act on it.

    Args:
        config_name: a file of conf/.
        act: takes the resolved config and returns the exit status.

    Returns:
        that status; 2 if the config is wrong, 130 after Ctrl-C.
    """

    def task(config: DictConfig) -> None:
        """The work, outside Hydra's own handling of errors."""
        try:
            status = act(plain_tree(config))
        except ConfigError as error:
            print(error, file=sys.stderr)
            raise SystemExit(REFUSED) from None
        if status != DONE:
            raise SystemExit(status)

    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra raises its errors, and they are worded here
    try:
        sys.argv[1:] = command_words(sys.argv[1:])
        hydra.main(config_path=str(CONF), config_name=config_name, **VERSION_BASE)(task)()
    except KeyboardInterrupt:
        return STOPPED
    except Exception as error:
        print(explain(error), file=sys.stderr)
        return REFUSED
    return DONE
