"""From a composed config to checked settings.

Each command has its way in. They refuse unknown keys, wrong types and values out of range before
any work starts, and report all that is wrong at once: single values, then what does not match.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import omegaconf
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from omegaconf.resolvers import oc

from experiments.config.control_checks import (
    control_hypothesis_problems,
    control_truth_problems,
)
from experiments.config.number_checks import (
    advice_count_problems,
    budget_problems,
    count_problems,
    point_cell_problems,
    recorded_cell_problems,
    refined_problems,
    resolution_problems,
    size_problems,
    soft_problems,
    study_problems,
    trial_problems,
)
from experiments.config.paths import HasResults, results_folder
from experiments.config.problems import ConfigError, checked
from experiments.config.settings import (
    AdviceSettings,
    RecordedSettings,
    RunSettings,
    Settings,
    StudySettings,
    TableSettings,
)
from experiments.config.shape_checks import (
    advice_shape_problems,
    point_shape_problems,
    recorded_shape_problems,
    shape_problems,
    table_problems,
)
from experiments.config.truth_checks import (
    hypothesis_problems,
    safe_set_problems,
    truth_problems,
)
from experiments.tracking.files import make_writable
from experiments.tracking.trees import flatten

__all__ = [
    "ConfigError",
    "plain_tree",
    "read_advice_config",
    "read_config",
    "read_recorded_config",
    "read_table_config",
    "resolved_tree",
    "settings_of_record",
    "writable_results",
]

_MARK = "variable_of_the_environment_"  # what stands for the value of one

_Part = TypeVar("_Part", Settings, StudySettings)


def read_config(tree: Mapping[str, Any]) -> tuple[Settings, StudySettings]:
    """Settings of a point and of its study from a resolved config of experiments/run.py.

    Args:
        tree: plain nested dicts and lists, every interpolation resolved.

    Raises:
        ConfigError: listing every problem.
    """
    everything = checked(RunSettings, tree)
    settings, study = _part(Settings, everything), _part(StudySettings, everything)
    # Each group of checks relies on the one before.
    _refuse(study_problems(study), count_problems(settings), point_cell_problems(settings))
    _refuse(shape_problems(settings), point_shape_problems(settings), truth_problems(settings))
    _refuse(size_problems(settings), trial_problems(settings))
    _refuse(refined_problems(settings), resolution_problems(settings))
    _refuse(hypothesis_problems(settings), control_truth_problems(settings))
    _refuse(control_hypothesis_problems(settings))
    _refuse(safe_set_problems(settings))
    return settings, study


def settings_of_record(config: Mapping[str, Any]) -> Settings:
    """The settings of a point that has run, from the config in its record.

    Raises:
        ConfigError: listing every problem, as where settings have changed since.
    """
    return checked(Settings, _written(config))


def _written(tree: Any) -> Any:
    """A tree of a record as one writes it: with `_target_` and arguments beside it."""
    if isinstance(tree, Mapping):
        if tree.keys() == {"target", "arguments"}:
            return {"_target_": tree["target"], **tree["arguments"]}
        return {key: _written(part) for key, part in tree.items()}
    return [_written(part) for part in tree] if isinstance(tree, list | tuple) else tree


def read_recorded_config(tree: Mapping[str, Any]) -> RecordedSettings:
    """Settings from a resolved config of experiments/infer.py.

    Raises:
        ConfigError: listing every problem.
    """
    # How demonstrations are made, which a system brings, plays no part.
    tasks, chosen = tree.get("tasks"), tree.get("next_tasks")
    used = _without(tree, ("tasks", "safety", "truth"))
    used["tasks"] = None if isinstance(tasks, Mapping) else tasks
    # But what to record next is drawn from the system's box, unless another one is given.
    if isinstance(chosen, Mapping):
        box = chosen.get("box") or (tasks if isinstance(tasks, Mapping) else None)
        if isinstance(box, Mapping):
            used["next_tasks"] = {**chosen, "box": {"goal": None, **_without(box, ("crossing",))}}
    settings = checked(RecordedSettings, used)
    _refuse(
        shape_problems(settings),
        recorded_shape_problems(settings),
        recorded_cell_problems(settings),
    )
    _refuse(control_hypothesis_problems(settings))
    _refuse(size_problems(settings), soft_problems(settings), refined_problems(settings))
    return settings


def read_table_config(tree: Mapping[str, Any]) -> TableSettings:
    """Settings from a resolved config of experiments/infer.py with a table.

    Raises:
        ConfigError: listing every problem.
    """
    # Of the kind of evidence, the rates alone: a table has no cells and no demonstrator.
    rates = tree.get("inference")
    if isinstance(rates, Mapping):
        tree = {
            **tree,
            "inference": _without(
                rates, ("exact_ends", "calibrate", "size_prior", "sets", "shapes")
            ),
        }
    settings = checked(TableSettings, tree)
    _refuse(table_problems(settings))
    return settings


def read_advice_config(tree: Mapping[str, Any]) -> AdviceSettings:
    """Settings from a resolved config of experiments/advise.py.

    Raises:
        ConfigError: listing every problem.
    """
    # How demonstrations are made plays no part; time steps and samples in a cell are compared.
    unused = ("safety", "truth", "dt", "transition", "temperature", "inference")
    settings = checked(AdviceSettings, _without(tree, unused))
    _refuse(advice_count_problems(settings))
    _refuse(advice_shape_problems(settings))
    _refuse(budget_problems(settings), refined_problems(settings))
    return settings


def writable_results(settings: HasResults, part: str) -> Path:
    """The folder of results, made if need be, in a part of which a file could be written just now.

    Args:
        settings: name the folder.
        part: the folder in it that is written to; another user may have made it.

    Raises:
        ConfigError: nothing can be written there, which is best known before hours of work.
    """
    folder = results_folder(settings)
    try:
        make_writable(folder / part)
        return folder
    except OSError as error:
        raise ConfigError(
            f"results: nothing can be written into {folder / part} ({error.strerror}); name a "
            "folder of your own: results=FOLDER"
        ) from None


def plain_tree(config: DictConfig) -> dict[str, Any]:
    """A composed config as resolved dicts and lists, without Hydra's own part.

    Raises:
        ConfigError: an interpolation that leads nowhere, or to what a record must not hold.
    """
    tree: Any = OmegaConf.to_container(config)
    tree.pop("hydra", None)
    return resolved_tree(OmegaConf.create(tree))


def resolved_tree(config: DictConfig) -> dict[str, Any]:
    """A config without Hydra's own part as resolved dicts and lists.

    Raises:
        ConfigError: an interpolation that leads nowhere, or to what a record must not hold.
    """
    # First with a mark for each variable of the environment, however a key comes to hold it.
    asked: list[str] = []

    def mark(name: str, *_: object) -> str:
        asked.append(name)
        return f"{_MARK}{name}"

    marked = _resolved(config, mark)
    if not asked:
        return marked
    written: Any = OmegaConf.to_container(config)
    _refuse(_secret_problems(marked, flatten(written)))
    return _resolved(config, oc.env)


def _resolved(config: DictConfig, variable: Callable[..., Any]) -> dict[str, Any]:
    """A config with every interpolation resolved, with a function for `oc.env`."""
    # OmegaConf 2.4, which Hydra 1.4 brings, swaps the names of the new and the old function.
    older = omegaconf.__version__ < "2.4"
    name = "register_new_resolver" if older else "register_resolver"
    register: Callable[..., None] = getattr(OmegaConf, name)
    register("oc.env", variable, replace=True)
    try:
        resolved: Any = OmegaConf.to_container(config, resolve=True)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{error.full_key}: {str(error).splitlines()[0]}") from None
    finally:
        register("oc.env", oc.env, replace=True)
    return dict(resolved)


def _secret_problems(marked: Mapping[str, Any], written: Mapping[str, Any]) -> Iterator[str]:
    """Variables of the environment in what records keep; paths are not kept, or not secret.

    Args:
        marked: a config with a mark in place of each variable.
        written: the same before it was resolved, by dotted keys.
    """
    for key, value in flatten(dict(marked)).items():
        if _MARK in str(value) and key not in ("results", "demonstrations", "table"):
            yield (
                f"{key}: {written.get(key, value)} would be kept in records, where everybody can "
                "read a variable of your environment; write its value, if that is no secret"
            )


def _part(kind: type[_Part], settings: RunSettings) -> _Part:
    """The fields of one kind of settings."""
    return kind(**{field.name: getattr(settings, field.name) for field in fields(kind)})


def _without(tree: Mapping[str, Any], keys: Collection[str]) -> dict[str, Any]:
    """A config without some of its keys."""
    return {key: value for key, value in tree.items() if key not in keys}


def _refuse(*checks: Iterable[str]) -> None:
    """Raise all problems of a group of checks together."""
    if problems := [problem for check in checks for problem in check]:
        raise ConfigError("\n".join(problems))
