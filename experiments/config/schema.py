"""Plain nested values to typed frozen dataclasses, with every mismatch reported by its full key."""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import Any

_PI = re.compile(
    r"\s*([+-]?)\s*(?:(\d+(?:\.\d+)?)(?:\s*/\s*(\d+))?)?\s*\*?\s*pi\s*(?:/\s*(\d+))?\s*"
)

Parser = Callable[[Any, str, "Problems"], Any]


class Problems:
    """What is wrong with a config: one message for each key, in the order found."""

    def __init__(self) -> None:
        self.messages: list[str] = []

    def __bool__(self) -> bool:
        return bool(self.messages)

    def add(self, message: str) -> None:
        """Add a message that opens with the full dotted key."""
        self.messages.append(message)


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """The end of a message about an unknown word: the nearest known one, or all of them."""
    known = sorted(known)
    near = difflib.get_close_matches(str(word), known, n=1, cutoff=0.6)
    return f"; did you mean {near[0]}?" if near else f"; known are {', '.join(known)}"


def parse(
    kind: Any,
    value: Any,
    key: str,
    problems: Problems,
    special: Mapping[type, Parser] | None = None,
) -> Any:
    """Read a plain value as a type hint says.

    Args:
        kind: a dataclass, float, int, bool, str, tuple[X, ...], a union of these and None, or
            anything else, which is passed through.
        value: nested dicts, lists and scalars.
        key: full dotted name of the value, for messages.
        problems: collects what does not fit.
        special: own parsers for some types.

    Returns:
        the typed value; meaningless if a problem was added.
    """
    special = special or {}
    if kind in special:
        return special[kind](value, key, problems)
    if dataclasses.is_dataclass(kind):
        return _parse_dataclass(kind, value, key, problems, special)
    origin = typing.get_origin(kind)
    if origin in (typing.Union, types.UnionType):
        return _parse_union(typing.get_args(kind), value, key, problems, special)
    if origin is tuple:
        if not isinstance(value, list | tuple):
            return _refuse(problems, key, value, "a list")
        entry = typing.get_args(kind)[0]
        return tuple(
            parse(entry, part, f"{key}[{i}]", problems, special) for i, part in enumerate(value)
        )
    if kind is float:
        return _parse_float(value, key, problems)
    if kind in (int, bool, str):
        if type(value) is not kind:
            names = {int: "a whole number", bool: "true or false", str: "a word"}
            return _refuse(problems, key, value, names[kind])
        return value
    return value


def field_keys(cls: Any, prefix: str = "") -> list[str]:
    """Dotted names of a dataclass's fields, and of the fields of those that are dataclasses."""
    names = []
    for name, kind in typing.get_type_hints(cls).items():
        names.append(prefix + name)
        if dataclasses.is_dataclass(kind):
            names += field_keys(kind, f"{prefix}{name}.")
    return names


def _parse_dataclass(
    cls: Any, value: Any, key: str, problems: Problems, special: Mapping[type, Parser]
) -> Any:
    """A mapping with exactly the fields of a dataclass."""
    if not isinstance(value, Mapping):
        return _refuse(problems, key, value, "a group of values")
    hints = typing.get_type_hints(cls)
    names = [field.name for field in dataclasses.fields(cls)]
    before, prefix = len(problems.messages), f"{key}." if key else ""
    for name in value:
        if name not in names:
            problems.add(f"{prefix}{name}: unknown key{did_you_mean(name, names)}")
    fields = {}
    for name in names:
        if name not in value or value[name] == "???":
            problems.add(f"{prefix}{name}: missing; give it a value")
        else:
            fields[name] = parse(hints[name], value[name], prefix + name, problems, special)
    return cls(**fields) if len(problems.messages) == before else None


def _parse_union(
    kinds: tuple[Any, ...], value: Any, key: str, problems: Problems, special: Mapping[type, Parser]
) -> Any:
    """The member of a union that suits the value's form: null, a list, or a scalar."""
    if value is None and type(None) in kinds:
        return None
    left = [kind for kind in kinds if kind is not type(None)]
    lists = [kind for kind in left if typing.get_origin(kind) is tuple]
    scalars = [kind for kind in left if typing.get_origin(kind) is not tuple]
    chosen = lists if lists and (isinstance(value, list | tuple) or not scalars) else scalars
    return parse(chosen[0], value, key, problems, special)


def _parse_float(value: Any, key: str, problems: Problems) -> float | None:
    """A finite number, or a multiple of pi in words: "6/5 pi", "-pi/2"."""
    if isinstance(value, str) and (match := _PI.fullmatch(value)):
        sign, factor, divisor, end = match.groups()
        size = float(factor or 1) / float(divisor or 1) / float(end or 1) * math.pi
        return -size if sign == "-" else size
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        _refuse(problems, key, value, 'a finite number, or a multiple of pi such as "6/5 pi"')
        return None
    return float(value)


def _refuse(problems: Problems, key: str, value: Any, wanted: str) -> None:
    """Report a value of the wrong type, cut short where it is long."""
    shown = repr(value)
    shown = shown if len(shown) <= 60 else shown[:57] + "..."
    problems.add(f"{key or 'config'}: {shown} is not {wanted}")
