"""From a resolved config to checked settings.

`read_config` is the one way in. It refuses unknown keys, wrong types and values out of range
before any work starts, and reports all that is wrong with a config at once.
"""

from __future__ import annotations

import dataclasses
import inspect
import typing
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from itertools import chain
from typing import Any, TypeVar

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from experiments.config.checks import (
    advice_number_problems,
    advice_problems,
    count_problems,
    number_problems,
    shape_problems,
    size_problems,
    study_problems,
    task_problems,
    truth_problems,
    truth_shape_problems,
)
from experiments.config.schema import Problems, did_you_mean, field_keys, parse
from experiments.config.settings import (
    AdviceSettings,
    RecordedSettings,
    Settings,
    StudySettings,
    SubjectSettings,
    SystemSettings,
    system_class,
)
from mlci.system_check import check_system

_Subject = TypeVar("_Subject", bound=SubjectSettings)


class ConfigError(Exception):
    """A config that cannot be run; the message has a line for each thing to put right."""


def read_config(tree: Mapping[str, Any]) -> tuple[Settings, StudySettings]:
    """Check a resolved config.

    Args:
        tree: plain nested dicts and lists, every interpolation resolved.

    Raises:
        ConfigError: listing every problem found.
    """
    problems = Problems()
    study_keys = {field.name for field in dataclasses.fields(StudySettings)}
    point_keys = {field.name for field in dataclasses.fields(Settings)}
    for key in tree:
        if key not in study_keys | point_keys:
            problems.add(f"{key}: unknown key{did_you_mean(key, study_keys | point_keys)}")
    study = parse(StudySettings, {k: tree[k] for k in tree if k in study_keys}, "", problems)
    point = {k: tree[k] for k in tree if k in point_keys}
    settings = parse(Settings, point, "", problems, {SystemSettings: _parse_system})
    # Each group of checks relies on the one before.
    for check in (
        lambda: study_problems(study),
        lambda: chain(number_problems(settings), count_problems(settings)),
        lambda: chain(shape_problems(settings), truth_shape_problems(settings)),
        lambda: size_problems(settings),
        lambda: truth_problems(settings),
    ):
        _check(problems, check)
    return settings, study


def read_recorded_config(tree: Mapping[str, Any]) -> RecordedSettings:
    """Check a resolved config of experiments/infer.py.

    Raises:
        ConfigError: listing every problem found.
    """
    return _read_subject(
        RecordedSettings,
        tree,
        ("tasks", "safety", "truth"),  # how demonstrations are made
        number_problems,
        lambda settings: chain(shape_problems(settings), task_problems(settings)),
        size_problems,
    )


def read_advice_config(tree: Mapping[str, Any]) -> AdviceSettings:
    """Check a resolved config of experiments/advise.py.

    Raises:
        ConfigError: listing every problem found.
    """
    return _read_subject(
        AdviceSettings,
        tree,
        ("safety", "transition", "truth"),  # how demonstrations are made, and what is compared
        advice_number_problems,
        advice_problems,
    )


def _read_subject(
    kind: type[_Subject],
    tree: Mapping[str, Any],
    unused: Collection[str],
    *checks: Callable[[_Subject], Iterable[str]],
) -> _Subject:
    """Settings without those keys of a system's config that they have no use for.

    Each check relies on the one before.
    """
    problems = Problems()
    known = {key: tree[key] for key in tree if key not in unused}
    settings = parse(kind, known, "", problems, {SystemSettings: _parse_system})
    for check in checks:
        _check(problems, partial(check, settings))
    return settings


def _check(problems: Problems, check: Callable[[], Iterable[str]]) -> None:
    """Raise what was found so far, or what one more check finds."""
    if not problems:
        for message in check():
            problems.add(message)
    if problems:
        raise ConfigError("\n".join(problems.messages))


def known_keys() -> list[str]:
    """Every dotted key that a config may hold, groups included."""
    return sorted([*field_keys(StudySettings), *field_keys(Settings), "experiment", "subject"])


def _parse_system(tree: Any, key: str, problems: Problems) -> SystemSettings | None:
    """Check a system's target, and its arguments against the constructor."""
    if not isinstance(tree, Mapping) or not isinstance(tree.get("_target_"), str):
        problems.add(f"{key}._target_: missing; name a class, such as mlci.systems.Pendulum")
        return None
    try:
        cls = system_class(tree["_target_"])
    except ValueError as error:
        problems.add(f"{key}._target_: {error}")
        return None
    before = len(problems.messages)
    parameters = inspect.signature(cls).parameters
    try:
        hints = typing.get_type_hints(cls.__init__)
    except Exception as error:
        problems.add(f"{key}._target_: type hints of {cls.__name__} cannot be read: {error}")
        return None
    for name in tree:
        if name != "_target_" and name not in parameters:
            known = did_you_mean(name, parameters)
            problems.add(f"{key}.{name}: {cls.__name__} has no such argument{known}")
    arguments: dict[str, Any] = {}
    for name, parameter in parameters.items():
        if name in tree:
            arguments[name] = parse(hints.get(name, Any), tree[name], f"{key}.{name}", problems)
        elif parameter.default is not parameter.empty:
            arguments[name] = parameter.default
        else:
            problems.add(f"{key}.{name}: missing; {cls.__name__} needs it")
    settings = SystemSettings(tree["_target_"], arguments)
    if len(problems.messages) == before:
        try:
            check_system(settings.build())
        except (TypeError, ValueError) as error:
            problems.add(f"{key}: {error}")
        except Exception as error:  # it may be anybody's class
            problems.add(f"{key}: {cls.__name__} fails: {type(error).__name__}: {error}")
    return settings


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
