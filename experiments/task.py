"""What runs for one composed config, in this process or in a worker."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from experiments.config import ConfigError, read_config
from experiments.record import CHECKOUT, Point
from experiments.settings import RecordedSettings, StudySettings


def run_task(config: DictConfig) -> str:
    """Run the point of a composed config, unless it is finished; prints its log either way.

    Returns:
        the point's identity.

    Raises:
        ConfigError: the config cannot be run.
    """
    settings, study = read_config(plain_tree(config))
    point = Point(settings, results_folder(study))
    if point.is_done():
        print((point.folder / "log.txt").read_text(), end="")
        print(f"finished before: {point.folder}")
    else:
        point.run(print)
        print(f"written: {point.folder}")
    return point.identity


def plain_tree(config: DictConfig) -> dict[str, Any]:
    """A composed config as resolved dicts and lists, without Hydra's own part.

    Raises:
        ConfigError: an interpolation that leads nowhere.
    """
    tree: Any = OmegaConf.to_container(config)
    tree.pop("hydra", None)
    try:
        resolved: Any = OmegaConf.to_container(OmegaConf.create(tree), resolve=True)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{error.full_key}: {str(error).splitlines()[0]}") from None
    return dict(resolved)


def results_folder(settings: StudySettings | RecordedSettings) -> Path:
    """Where results go: the checkout's own folder unless another is given."""
    given = settings.results
    return CHECKOUT / "results" if given is None else Path(given).resolve()
