"""YAML as a person means it: numbers in decimals, every key once, and nothing that refers back."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import yaml

from experiments.config.problems import ConfigError

# What a word without quotes stands for, and the signs that it begins with; all else is a word.
_KINDS = (
    ("null", r"~|null|", ["~", "n", ""]),
    ("bool", r"[Tt]rue|[Ff]alse", list("TtFf")),
    ("int", r"[-+]?[0-9]{1,300}", list("-+0123456789")),
    ("float", r"[-+]?([0-9]+\.?|[0-9]*\.[0-9]+)([eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"[-+]?\.(inf|nan)", list("-+.")),
)


class _Loader(yaml.SafeLoader):
    """The safe loader with the words of YAML 1.2: 1e5 is a number, 010 is ten, `on` is a word."""

    yaml_implicit_resolvers: dict[str, list[Any]] = {}  # noqa: RUF012, filled below

    def compose_node(self, parent: Any, index: Any) -> Any:
        """A node that does not refer to another, which may hold it or grow without end."""
        if self.check_event(yaml.AliasEvent):
            event = self.peek_event()
            raise _problem(f"*{event.anchor} refers to another place; write it out", event)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """A mapping of scalar keys, each of which stands once."""
        lines: dict[str, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _problem("a key must be a word or a number", key)
            if key.value in lines:
                raise _problem(f"{key.value} stands in line {lines[key.value]} too; keep one", key)
            lines[key.value] = key.start_mark.line + 1
        return super().construct_mapping(node, deep=deep)

    def construct_decimal(self, node: Any) -> int:
        """A whole number, in decimals whatever it begins with."""
        return int(self.construct_scalar(node))


for _name, _form, _first in _KINDS:
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_name}", re.compile(f"^({_form})$"), _first)
_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_decimal)


def read_yaml(file: str | Path) -> Any:
    """What a YAML file holds.

    Raises:
        ConfigError: no file, no UTF-8, or no such YAML; in which line.
    """
    try:
        path = Path(file).expanduser()
        if path.exists() and not path.is_file():
            raise ConfigError(f"{file}: is not a file")
        return yaml.load(path.read_text(encoding="utf-8-sig"), _Loader)
    except (OSError, RuntimeError) as error:
        if isinstance(error, RecursionError):
            raise ConfigError(f"{file}: is nested too deeply") from None
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"{file}: cannot be read ({reason})") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: byte {error.start} is not UTF-8; save it as UTF-8") from None
    except yaml.YAMLError as error:
        mark, words = getattr(error, "problem_mark", None), getattr(error, "problem", None)
        line = f", line {mark.line + 1}" if mark else ""
        words = " ".join(str(words or error).split())
        raise ConfigError(f"{file}{line}: not valid YAML ({words})") from None
    except ValueError as error:  # of a tag such as !!int that does not suit
        raise ConfigError(f"{file}: not valid YAML ({error})") from None


def _problem(words: str, place: Any) -> yaml.MarkedYAMLError:
    """What is wrong at a node or an event."""
    return yaml.MarkedYAMLError(problem=words, problem_mark=place.start_mark)
