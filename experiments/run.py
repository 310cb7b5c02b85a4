"""Run one point, or with -m a sweep of them: python experiments/run.py [-m] [key=value ...]"""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before all that takes time to import
    from experiments import app

    sys.exit(app.run())

import os
import signal
import traceback

import hydra
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from experiments.app import DONE, FAILED, REFUSED, STOPPED, version_base
from experiments.collate.join import CollateError
from experiments.config.command_line import command_words
from experiments.config.explain import explain, of_config
from experiments.config.paths import CONF
from experiments.config.read import ConfigError
from experiments.sweep.planner import SweepFailed
from experiments.sweep.plugins import register_plugins
from experiments.sweep.worker import run_single


def main() -> int:
    """Run the command line's point or sweep.

    Returns:
        0 if all is done, 1 if a point failed, 2 if the config is wrong, 130 after Ctrl-C.
    """
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra raises its errors, and they are worded here
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # a clean stop, as after Ctrl-C
    register_plugins()
    try:
        sys.argv[1:] = command_words(sys.argv[1:])
        hydra.main(config_path=str(CONF), config_name="config", **version_base())(_run_once)()
    except KeyboardInterrupt:
        print("stopped; what has finished is kept: the same command runs the rest", file=sys.stderr)
        return STOPPED
    except (SweepFailed, CollateError) as error:
        print(error, file=sys.stderr)
        return FAILED
    except Exception as error:
        if isinstance(error, OSError) and not of_config(error):
            # No room or no right to write: nothing that a config could mend.
            print(f"{error}; what has finished is kept", file=sys.stderr)
            return FAILED
        print(explain(error), file=sys.stderr)
        return REFUSED
    return DONE


def _run_once(config: DictConfig) -> None:
    """The single point, outside Hydra's own handling of errors."""
    try:
        if any(HydraConfig.get().sweeper.get(key) for key in ("params", "cases")):
            raise ConfigError("experiment: this one describes a sweep; add -m to run it")
        run_single(config)
    except ConfigError as error:
        print(error, file=sys.stderr)
        raise SystemExit(REFUSED) from None
    except Exception:
        traceback.print_exc()
        raise SystemExit(FAILED) from None
