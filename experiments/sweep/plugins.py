"""The sweeper and the launchers, made known to Hydra."""

from __future__ import annotations

from functools import cache

from hydra.core.config_store import ConfigStore

_PLANNER = {"params": None, "settings": None, "cases": None, "ends": False}

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
    "tls": None,  # {ca_file: FILE, cert: FILE, key: FILE} of a cluster that asks for them
    "threads": "${workers}",  # of the cluster in this process
    "fail_fast": "${sweep.fail_fast}",
}

_POOL = {"workers": "${workers}", "fail_fast": "${sweep.fail_fast}"}


@cache  # Hydra 1.4 wants them once
def register_options() -> None:
    """Make known to Hydra which options sweeper and launchers have: all that a config needs."""
    for group, name, plugin, settings in (
        ("hydra/sweeper", "planner", "planner.Planner", _PLANNER),
        ("hydra/launcher", "pool", "pool.PoolLauncher", _POOL),
        ("hydra/launcher", "slurm", "slurm.SlurmLauncher", _SLURM),
        ("hydra/launcher", "dask", "dask_jobs.DaskLauncher", _DASK),
    ):
        node = {"_target_": f"experiments.sweep.{plugin}", **settings}
        ConfigStore.instance().store(group=group, name=name, node=node, provider="mlci")


@cache
def register_plugins() -> None:
    """Make the sweeper and the launchers known to Hydra, however the project is installed."""
    from hydra.core.plugins import Plugins

    from experiments.sweep.dask_jobs import DaskLauncher
    from experiments.sweep.planner import Planner
    from experiments.sweep.pool import PoolLauncher
    from experiments.sweep.slurm import SlurmLauncher

    register_options()
    # Hydra 1.3 accepts plugins of the package `hydra_plugins` only; 1.4 has no such rule.
    Plugins.is_in_toplevel_plugins_module = staticmethod(lambda target: True)  # type: ignore[assignment, method-assign]
    for plugin in (Planner, PoolLauncher, SlurmLauncher, DaskLauncher):
        Plugins.instance().register(plugin)
