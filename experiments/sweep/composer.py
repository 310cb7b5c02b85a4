"""The configs of a sweep's points: each choice of groups is composed once.

Hydra reads every file anew for every point; here each is read once. Values that a point sets itself
are put over what its groups compose to; so points which differ in values alone share all that comes
before. Where nothing refers to anything else, they also share the parts of the config in which they
set nothing.
"""

from __future__ import annotations

import pickle
import re
from collections.abc import Sequence
from copy import deepcopy
from functools import cache
from typing import Any

from hydra.core.config_loader import ConfigLoader
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, OverrideType
from hydra.plugins.config_source import ConfigSource
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from experiments.config.read import plain_tree, resolved_tree

_REFERENCE = "${"  # opens what another key's value, or a variable's, is put in place of
_TOP_KEY = re.compile(r"[.\[]")  # ends it


class Composer:
    """Composes points as Hydra's own loader does, from the config that the sweep began with."""

    def __init__(self, loader: ConfigLoader, base: DictConfig) -> None:
        self._loader, self._base = loader, base
        for source in loader.get_sources():
            _read_once(source)
        self._parser = OverridesParser.create(config_loader=loader)
        self._parsed = cache(self._parser.parse_override)
        self._is_group = cache(lambda key: bool(loader.get_group_options(key)))
        self._chosen = cache(self._compose)

    def tree(self, job: Sequence[str]) -> dict[str, Any]:
        """The resolved config of the point that some overrides make, without Hydra's own part.

        Raises:
            ConfigError: an interpolation that leads nowhere.
            HydraException: overrides that Hydra refuses.
        """
        overrides = [self._parsed(word) for word in job]
        values = [override for override in overrides if self._sets_a_value(override)]
        choices = [word for word, each in zip(job, overrides, strict=True) if each not in values]
        composed, has_references = self._chosen(tuple(choices))
        parts = composed
        if not has_references and not any(_REFERENCE in word for word in job):
            changed = {_TOP_KEY.split(override.key_or_group)[0] for override in values}
            parts = {key: composed[key] for key in composed if key in changed}
        config = OmegaConf.create(parts, flags={"struct": True})
        try:
            for override in values:
                OmegaConf.update(config, override.key_or_group, override.value(), merge=True)
        except OmegaConfBaseException:  # Hydra says better what is wrong
            return plain_tree(self._loader.load_sweep_config(self._base, list(job)))
        return _copy(composed) | resolved_tree(config)

    def _sets_a_value(self, override: Override) -> bool:
        """Whether an override changes a value that is there once the groups are composed."""
        key = override.key_or_group
        return (
            override.type is OverrideType.CHANGE
            and override.package is None
            and not override.is_hydra_override()
            and not self._is_group(key)
        )

    def _compose(self, choices: tuple[str, ...]) -> tuple[dict[str, Any], bool]:
        """What Hydra composes, not resolved yet and without its part; whether it has references."""
        config: Any = OmegaConf.to_container(self._loader.load_sweep_config(self._base, [*choices]))
        config.pop("hydra")
        return dict(config), _REFERENCE in str(config)


def _read_once(source: ConfigSource) -> None:
    """Have a source of configs remember its files, whose parsing is a third of composing."""
    remembered: Any = cache(source.load_config)
    anew: Any = lambda config_path: deepcopy(remembered(config_path))  # noqa: E731
    source.load_config = anew  # type: ignore[method-assign]


def _copy(tree: dict[str, Any]) -> dict[str, Any]:
    """A copy of a tree that shares no part with it, ten times as fast as `deepcopy`."""
    copied: dict[str, Any] = pickle.loads(pickle.dumps(tree))
    return copied
