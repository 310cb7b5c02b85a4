"""What a config names by `_target_`: a thing of a module, and the arguments that it takes."""

from __future__ import annotations

import importlib
import inspect
import traceback
import types
import typing
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, TypeVar

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


def target_of(tree: Any, example: str) -> str:
    """The dotted name in a tree's `_target_`.

    Raises:
        ValidationError: there is none.
    """
    target = tree.get("_target_") if isinstance(tree, Mapping) else None
    if not isinstance(target, str):
        raise target_error(tree, f"missing; name {example}")
    return target


def named(target: str) -> Any:
    """What a dotted name stands for.

    Raises:
        ValueError: it cannot be imported.
    """
    module_name, _, name = target.rpartition(".")
    try:
        module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # it may be anybody's module
        raise ValueError(f"{target!r} cannot be imported: {_reason(error, module_name)}") from None
    if not hasattr(module, name):
        where = getattr(module, "__file__", None) or module_name
        raise ValueError(f"{target!r} cannot be imported: {where} defines no {name}")
    return getattr(module, name)


def arguments_of(
    callee: Callable[..., Any], target: str, tree: Mapping[str, Any]
) -> dict[str, Any]:
    """Every argument of a class or a function, with its default where the config names none.

    Args:
        callee: the class or the function.
        target: its dotted name.
        tree: what the config says, beside `_target_`.

    Raises:
        ValidationError: an argument that it does not take, lacks, or takes otherwise.
    """
    try:
        _hints(callee)
    except Exception as error:  # anybody's hints
        words = f"type hints of {target.rpartition('.')[2]} cannot be read: {error}"
        raise target_error(target, words) from None
    given = {key: value for key, value in tree.items() if key != "_target_"}
    checked = _strict(callee).validate_python(given)
    parameters = inspect.signature(callee).parameters
    return {name: checked.get(name, parameter.default) for name, parameter in parameters.items()}


@cache
def _hints(callee: Callable[..., Any]) -> dict[str, Any]:
    """The type hints of the arguments of a class or a function."""
    hinted: Any = callee.__init__ if inspect.isclass(callee) else callee
    return typing.get_type_hints(hinted)


@cache  # a sweep asks for it twice a point
def _strict(callee: Callable[..., Any]) -> TypeAdapter[Any]:
    """What checks the arguments of a class or a function."""
    hints, parameters = _hints(callee), inspect.signature(callee).parameters
    required, optional = typing_extensions.Required, typing_extensions.NotRequired
    fields = {
        name: (required if parameter.default is parameter.empty else optional)[
            _kind(hints.get(name, _ANY))
        ]
        for name, parameter in parameters.items()
    }
    arguments: Any = typing_extensions.TypedDict("arguments", fields)  # type: ignore[misc]
    return TypeAdapter(with_config(STRICT)(arguments))


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


@dataclass(frozen=True, config=STRICT)
class FunctionSettings:
    """What a function or class of one's own makes of its arguments."""

    target: Annotated[Word, about("dotted name of what makes it")]
    arguments: Annotated[Mapping[str, Any], about("what it takes")]

    def made(self) -> Any:
        """The thing itself."""
        return named(self.target)(**self.arguments)


F = TypeVar("F", bound=FunctionSettings)


def read_function(kind: type[F], tree: Any, example: str, wanted: type, what: str) -> F:
    """What `_target_` makes of the arguments beside it, tried once.

    Args:
        kind: of the settings.
        tree: what the config says; settings are left as they are.
        example: what `_target_` should be, in words.
        wanted: what it must make,
        what: in words.

    Raises:
        ValidationError: an argument that it does not take, lacks, or takes otherwise.
        PydanticCustomError: nothing that makes what is wanted.
    """
    if isinstance(tree, kind):
        return tree
    target = target_of(tree, example)
    try:
        maker = named(target)
    except ValueError as error:
        raise target_error(target, str(error)) from None
    if not callable(maker):
        raise target_error(target, f"{target!r} is no function")
    settings = kind(target, arguments_of(maker, target, tree))
    try:
        made = settings.made()
    except Exception as error:  # it may be anybody's function
        raise problem(f"{target} fails: {type(error).__name__}: {error}") from None
    if not isinstance(made, wanted):
        raise problem(f"{target} must return {what}, not {type(made).__name__}")
    return settings


def target_error(value: Any, words: str) -> ValidationError:
    """What is wrong with the name of the class."""
    details = InitErrorDetails(type=problem(words), loc=("_target_",), input=value)
    return ValidationError.from_exception_data("system", [details])


def problem(words: str) -> PydanticCustomError:
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
