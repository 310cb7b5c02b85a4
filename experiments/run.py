"""Run one point, or with -m a sweep of them: python experiments/run.py [-m] [key=value ...]"""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before all that takes time to import
    from experiments import app

    sys.exit(app.run())

import signal
from typing import Any

from hydra.core.hydra_config import HydraConfig

from experiments.app import DONE, STOPPED, run_command
from experiments.collate.finished import CollateError
from experiments.config.read import ConfigError
from experiments.point.no_answer import NoAnswer
from experiments.sweep.messages import SweepFailed
from experiments.sweep.plugins import register_options, register_plugins
from experiments.sweep.worker import run_single

_SWEEP = ("params", "settings", "cases")


def main() -> int:
    """Run the command line's point or sweep; returns the exit status."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # a clean stop, as after Ctrl-C
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # which it is below nohup
        signal.signal(signal.SIGHUP, signal.default_int_handler)
    register_options()
    status = run_command(
        "config",
        _run_single,
        failures=(SweepFailed, CollateError, NoAnswer),
        register_sweeper=register_plugins,
    )
    if status == STOPPED:
        print("stopped; what has finished is kept: the same command runs the rest", file=sys.stderr)
    return status


def _run_single(tree: dict[str, Any]) -> int:
    """Run the single point of a config; Hydra hands a sweep to our own sweeper instead."""
    if any(HydraConfig.get().sweeper.get(key) for key in _SWEEP):
        raise ConfigError("experiment: this one describes a sweep; add -m to run it")
    run_single(tree)
    return DONE
