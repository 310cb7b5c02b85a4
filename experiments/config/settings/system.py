"""The system: a class by its dotted name, its arguments checked against its constructor."""

from __future__ import annotations

import importlib
import inspect
import traceback
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typing_extensions
from pydantic import BeforeValidator, TypeAdapter, with_config
from pydantic.dataclasses import dataclass
from pydantic_core import InitErrorDetails, PydanticCustomError, ValidationError

from experiments.config.settings.kinds import (
    STRICT,
    Flag,
    Number,
    Whole,
    Word,
    about,
    one_or_list,
)
from mlci.system_check import check_system
from mlci.systems import System

_EXACT = 2.0**53  # floats below are equal to one whole number alone


def _one_spelling(value: Any) -> Any:
    """A value of any kind, in which a float that is a whole number is one."""
    if isinstance(value, list | tuple):
        return [_one_spelling(part) for part in value]
    is_whole = isinstance(value, float) and value.is_integer() and abs(value) < _EXACT
    return int(value) if is_whole else value


# Of an argument without a type hint: 4 and 4.0 are one.
_ANY = Annotated[Any, BeforeValidator(_one_spelling)]
_KINDS: dict[Any, Any] = {float: Number, int: Whole, bool: Flag, str: Word}


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
    target = tree.get("_target_") if isinstance(tree, Mapping) else None
    if not isinstance(target, str):
        raise _target_error(tree, "missing; name a class, such as mlci.systems.Pendulum")
    try:
        system = system_class(target)
        hints = typing.get_type_hints(system.__init__)
    except ValueError as error:
        raise _target_error(target, str(error)) from None
    except Exception as error:  # of the hints
        words = f"type hints of {target.rpartition('.')[2]} cannot be read: {error}"
        raise _target_error(target, words) from None
    settings = SystemSettings(target, _arguments(system, hints, tree))
    try:
        check_system(settings.build())
    except (TypeError, ValueError) as error:
        raise _problem(str(error)) from None
    except Exception as error:  # it may be anybody's class
        raise _problem(f"{system.__name__} fails: {type(error).__name__}: {error}") from None
    return settings


def system_class(target: str) -> type[System]:
    """The concrete System that a dotted path names.

    Raises:
        ValueError: it cannot be imported, or is something else.
    """
    module_name, _, name = target.rpartition(".")
    try:
        module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # it may be anybody's module
        raise ValueError(f"{target!r} cannot be imported: {_reason(error, module_name)}") from None
    system = getattr(module, name, None)
    if system is None:
        where = getattr(module, "__file__", None) or module_name
        raise ValueError(f"{target!r} cannot be imported: {where} defines no {name}")
    if not (inspect.isclass(system) and issubclass(system, System)) or system is System:
        raise ValueError(f"{target!r} is not a subclass of mlci.systems.System")
    if missing := ", ".join(sorted(system.__abstractmethods__)):
        raise ValueError(f"{target!r} does not define {missing}")
    return system


def _arguments(
    system: type[System], hints: Mapping[str, Any], tree: Mapping[str, Any]
) -> dict[str, Any]:
    """Every argument of a constructor, with its default where the config does not name it."""
    parameters = inspect.signature(system).parameters
    required, optional = typing_extensions.Required, typing_extensions.NotRequired
    fields = {
        name: (required if parameter.default is parameter.empty else optional)[
            _kind(hints.get(name, _ANY))
        ]
        for name, parameter in parameters.items()
    }
    arguments: Any = typing_extensions.TypedDict("arguments", fields)  # type: ignore[misc]
    strict = TypeAdapter(with_config(STRICT)(arguments))
    words = {key: value for key, value in tree.items() if key != "_target_"}
    checked = strict.validate_python(words)
    return {name: checked.get(name, parameter.default) for name, parameter in parameters.items()}


def _kind(hint: Any) -> Any:
    """The strict kind that a constructor's type hint stands for; Any where there is none."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin is tuple:
        return tuple[tuple(part if part is ... else _kind(part) for part in parts)]  # type: ignore[misc]
    if origin in (typing.Union, types.UnionType):
        lists = [_kind(part) for part in parts if typing.get_origin(part) is tuple]
        others = [_kind(p) for p in parts if typing.get_origin(p) is not tuple and p is not None]
        others = [kind for kind in others if kind is not type(None)]
        kind = one_or_list(others[0], lists[0]) if others and lists else [*others, *lists][0]
        return typing.Optional[kind] if type(None) in parts else kind  # noqa: UP045
    return hint if hint is type(None) else _KINDS.get(hint, _ANY)


def _target_error(value: Any, words: str) -> ValidationError:
    """What is wrong with the name of the class."""
    details = InitErrorDetails(type=_problem(words), loc=("_target_",), input=value)
    return ValidationError.from_exception_data("system", [details])


def _problem(words: str) -> PydanticCustomError:
    """An error in our words, whatever braces they hold."""
    return PydanticCustomError("problem", "{words}", {"words": words})


def _reason(error: BaseException, module_name: str) -> str:
    """Why a module cannot be imported, and where."""
    if isinstance(error, ModuleNotFoundError) and error.name == module_name.partition(".")[0]:
        return f"there is no module {error.name} in {Path.cwd()}, nor installed"
    frames = traceback.extract_tb(error.__traceback__)
    theirs = [frame for frame in frames if "importlib" not in frame.filename][1:]  # 0 is ours
    where = "".join(f"{frame.filename}, line {frame.lineno}: " for frame in theirs[-1:])
    return where + " ".join(f"{type(error).__name__}: {error}".split())
