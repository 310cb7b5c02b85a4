"""The system: a class by its dotted name, its arguments checked against its constructor."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import STRICT, Word, about
from experiments.config.settings.targets import (
    arguments_of,
    named,
    problem,
    target_error,
    target_of,
)
from mlci.system_check import check_system
from mlci.systems import System


@dataclass(frozen=True, config=STRICT)
class SystemSettings:
    """A subclass of mlci.systems.System by its dotted name, and its constructor's arguments."""

    target: Annotated[Word, about("dotted name of a subclass of mlci.systems.System")]
    arguments: Annotated[Mapping[str, Any], about("what its constructor takes")]

    def build(self) -> System:
        """The system itself."""
        return system_class(self.target)(**self.arguments)


def read_system(tree: Any) -> SystemSettings:
    """A system from `_target_` and the arguments beside it.

    Raises:
        ValidationError: an argument that the constructor does not take, lacks, or takes otherwise.
        PydanticCustomError: a system that cannot be built, or does not keep its promises.
    """
    if isinstance(tree, SystemSettings):
        return tree
    target = target_of(tree, "a class, such as mlci.systems.Pendulum")
    try:
        system = system_class(target)
    except ValueError as error:
        raise target_error(target, str(error)) from None
    settings = SystemSettings(target, arguments_of(system, target, tree))
    try:
        check_system(settings.build())
    except (TypeError, ValueError) as error:
        raise problem(str(error)) from None
    except Exception as error:  # it may be anybody's class
        raise problem(f"{system.__name__} fails: {type(error).__name__}: {error}") from None
    return settings


def system_class(target: str) -> type[System]:
    """The concrete System that a dotted path names.

    Raises:
        ValueError: it cannot be imported, or is something else.
    """
    system = named(target)
    if not (inspect.isclass(system) and issubclass(system, System)) or system is System:
        raise ValueError(f"{target!r} is not a subclass of mlci.systems.System")
    if missing := ", ".join(sorted(system.__abstractmethods__)):
        raise ValueError(f"{target!r} does not define {missing}")
    return system
