"""Validation errors of pydantic as lines for a person: full key, value, and what to do."""

from __future__ import annotations

import dataclasses
import inspect
import typing
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from pydantic import TypeAdapter, ValidationError

from experiments.config.settings import (
    PredicateSettings,
    ShapeSettings,
    SystemSettings,
    system_class,
)
from experiments.config.settings.kinds import LIST, ONE, WORD
from experiments.config.suggestions import did_you_mean
from experiments.tracking.own_modules import put_on_path

T = typing.TypeVar("T")


class ConfigError(Exception):
    """A config that cannot be run; the message has a line for each thing to put right."""


# By pydantic's type of an error; its numbers fill in the words.
_WORDS = {
    "missing": "missing; give it a value",
    "number_type": '{value} is not a finite number, or a multiple of pi such as "6/5 pi"',
    **dict.fromkeys(("int_type", "int_from_float"), "{value} is not a whole number"),
    "bool_type": "{value} is not true or false",
    "string_type": "{value} is not a word",
    "tuple_type": "{value} is not a list",
    **dict.fromkeys(("dataclass_type", "dict_type"), "{value} is not a group of values"),
    "literal_error": "{value} must be {expected}",
    "greater_than": "{value} must be above {gt:.16g}",
    "greater_than_equal": "{value} must be at least {ge:.16g}",
    "less_than": "{value} must be below {lt:.16g}",
    "less_than_equal": "{value} must be at most {le:.16g}",
    "too_short": "{value} is empty; give at least one",
    "too_long": "{value} has {actual_length} entries; give {max_length}",
    "problem": "{words}",
}

# By the name of a class whose values are groups.
_EXAMPLES = {
    "Region": "is not a region; write its ends in each dimension, such as {lower: [3.1, -0.1], "
    "upper: [3.2, 0.1]}",
    "BallSettings": "is not a ball; write its centre and semi-axes, such as {center: [3.1, 0.0], "
    "radii: [0.2, 0.5]}",
    "ControlRange": "is not a range of controls; write its ends, null where there is none, such as "
    "{lower: [1.0], upper: [null]}",
    "HalfSpaceSettings": "is not a half-space; write {normal: [0.0, 1.0], offset: 0.5} for what "
    "is above 0.5 in the second dimension",
}


def checked(kind: type[T], tree: Mapping[str, Any]) -> T:
    """A tree of plain values as settings; its system may be of the current folder's modules.

    Raises:
        ConfigError: with a line for each value that does not fit.
    """
    for target in _targets(tree):
        put_on_path(target)
    try:
        settings: T = _adapter(typing.cast(Any, kind)).validate_python(_without_missing(tree))
        return settings
    except ValidationError as error:
        raise ConfigError("\n".join(_lines(error, kind, tree))) from None


@cache
def _adapter(kind: type[Any]) -> TypeAdapter[Any]:
    """What checks settings of a kind; it takes a tenth of a second to build."""
    return TypeAdapter(kind)


def _targets(tree: Any) -> Iterator[str]:
    """Every `_target_` in a tree."""
    if isinstance(tree, Mapping):
        if isinstance(target := tree.get("_target_"), str):
            yield target
        tree = list(tree.values())
    if isinstance(tree, list | tuple):
        for part in tree:
            yield from _targets(part)


_MADE = SystemSettings, ShapeSettings, PredicateSettings  # what `_target_` names makes them


def field_keys(kind: Any, prefix: str = "") -> list[str]:
    """Dotted names of a dataclass's fields, and of the fields of those that hold dataclasses."""
    keys = []
    for name, hint in typing.get_type_hints(kind).items():
        keys.append(prefix + name)
        if (group := _group(hint)) and group not in _MADE:
            keys += field_keys(group, f"{prefix}{name}.")
    return keys


def _lines(error: ValidationError, kind: Any, tree: Mapping[str, Any]) -> Iterator[str]:
    """A line for each of the errors."""
    for each in error.errors(include_url=False):
        place = [part for part in each["loc"] if part not in (ONE, LIST, WORD, "[key]")]
        key = _dotted(place) or "config"
        least = each.get("ctx", {}).get("min_length", 0)
        if each["type"] == "too_short" and len(each["input"]) >= least:
            continue  # entries that are wrong do not count, and have lines of their own
        if each["type"] in ("unexpected_keyword_argument", "extra_forbidden", "invalid_key"):
            yield f"{key}: {_unknown(place, kind, tree)}"
        elif each["type"] == "missing" and place[0] == "system" and "system" in tree:
            name = tree["system"]["_target_"].rpartition(".")[2]
            yield f"{key}: missing; {name} needs it"
        elif each["type"] == "dataclass_type" and each["ctx"]["class_name"] in _EXAMPLES:
            yield f"{key}: {_short(each['input'])} {_EXAMPLES[each['ctx']['class_name']]}"
        elif each["type"] == "too_short" and least > 1:
            yield f"{key}: {_short(each['input'])} has too few entries; give {least}"
        elif each["type"] in _WORDS:
            details = {**each.get("ctx", {}), "value": _short(each["input"])}
            yield f"{key}: " + _WORDS[each["type"]].format(**details)
        else:
            yield f"{key}: {_short(each['input'])} does not fit: {each['msg']}"


def _unknown(place: list[Any], kind: Any, tree: Mapping[str, Any]) -> str:
    """What to say about a key that nobody knows."""
    *parents, name = place
    if parents in (["system"], ["reality", "system"]):
        system = system_class(tree["system"]["_target_"])
        known = did_you_mean(name, inspect.signature(system).parameters)
        return f"{system.__name__} has no such argument{known}"
    return f"unknown key{did_you_mean(name, _keys_below(kind, parents))}"


def _keys_below(kind: Any, place: list[Any]) -> list[str]:
    """Names of the fields at a place, which may lead through groups, lists and named groups."""
    parts = iter(part for part in place if isinstance(part, str))
    for part in parts:
        hint = typing.get_type_hints(kind).get(part)
        if typing.get_origin(hint) is dict:
            next(parts, None)  # a name that the config gives
        kind = _group(hint)
    return list(typing.get_type_hints(kind)) if kind else []


def _group(hint: Any) -> Any:
    """The dataclass that a type hint is, or holds as an entry of a list or beside None."""
    if dataclasses.is_dataclass(hint):
        return hint
    return next(filter(None, map(_group, typing.get_args(hint))), None)


def _without_missing(tree: Any) -> Any:
    """A tree without the values that are still to be given, written `???`."""
    if isinstance(tree, dict):
        return {key: _without_missing(part) for key, part in tree.items() if part != "???"}
    return tree


def _dotted(place: list[Any]) -> str:
    """A key as one writes it, such as truth.boxes[0].lower."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    text = "".join(parts).removeprefix(".")
    return text if text.isprintable() else repr(text)


def _short(value: object) -> str:
    """A value as text, cut where it is long."""
    text = repr(list(value) if isinstance(value, tuple) else value)
    return text if len(text) <= 60 else text[:57] + "..."
