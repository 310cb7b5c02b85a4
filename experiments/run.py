"""Run one point, or with -m a sweep of them: python experiments/run.py [-m] [key=value ...]"""

from __future__ import annotations

import sys

if __name__ == "__main__":  # before all that takes time to import
    from experiments import commands

    sys.exit(commands.run())

import os
import signal
import traceback
from functools import cache

import hydra
from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from omegaconf import DictConfig

from experiments.config import ConfigError
from experiments.dask_engine import DaskLauncher
from experiments.errors import explain, of_config
from experiments.launcher import PoolLauncher
from experiments.own_folder import command_words
from experiments.places import CONF
from experiments.planner import Planner, SweepFailed
from experiments.slurm import SlurmLauncher
from experiments.tables import CollateError
from experiments.task import run_once

DONE, FAILED, REFUSED, STOPPED = 0, 1, 2, 130
# Hydra 1.3 warns where this is left out, and 1.4 where it is given.
VERSION_BASE = {"version_base": "1.3"} if hydra.__version__.startswith("1.3.") else {}


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
        hydra.main(config_path=str(CONF), config_name="config", **VERSION_BASE)(_run_once)()
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


_SLURM = {
    "jobs": 100,  # of the array; the points are dealt to them
    "poll": 2.0,  # [s] between looks at the queue
    "fail_fast": "${sweep.fail_fast}",
    # What each job asks for; null leaves it to the cluster.
    "partition": None,
    "timeout_min": 60,
    "cpus_per_task": 1,  # and as many points at once
    "mem_gb": None,
    "array_parallelism": 256,  # jobs that run at the same time
    "setup": None,  # shell commands before, as a list
    "additional_parameters": None,  # more of sbatch's options: {account: mine}
}


_DASK = {
    "jobs": 100,  # the points are dealt to them
    "scheduler": None,  # address of a running cluster; null starts one in this process
    "threads": "${workers}",  # of the cluster in this process
    "fail_fast": "${sweep.fail_fast}",
}


@cache  # Hydra 1.4 wants them once
def register_plugins() -> None:
    """Make the sweeper and the launcher known to Hydra, however the project is installed."""
    # Hydra 1.3 accepts plugins of the package `hydra_plugins` only; 1.4 has no such rule.
    Plugins.is_in_toplevel_plugins_module = staticmethod(lambda target: True)  # type: ignore[assignment, method-assign]
    for group, name, plugin, settings in (
        ("hydra/sweeper", "planner", Planner, {"params": None, "cases": None, "ends": False}),
        (
            "hydra/launcher",
            "pool",
            PoolLauncher,
            {"workers": "${workers}", "fail_fast": "${sweep.fail_fast}"},
        ),
        ("hydra/launcher", "slurm", SlurmLauncher, _SLURM),
        ("hydra/launcher", "dask", DaskLauncher, _DASK),
    ):
        Plugins.instance().register(plugin)
        target = f"{plugin.__module__}.{plugin.__name__}"
        node = {"_target_": target, **settings}
        ConfigStore.instance().store(group=group, name=name, node=node, provider="mlci")


def _run_once(config: DictConfig) -> None:
    """The single point, outside Hydra's own handling of errors."""
    try:
        if any(HydraConfig.get().sweeper.get(key) for key in ("params", "cases")):
            raise ConfigError("experiment: this one describes a sweep; add -m to run it")
        run_once(config)
    except ConfigError as error:
        print(error, file=sys.stderr)
        raise SystemExit(REFUSED) from None
    except Exception:
        traceback.print_exc()
        raise SystemExit(FAILED) from None
