"""Write what the settings tell: schemas for editors, tables of conf/README.md, texts of --help.

`python -m experiments.config.reference` writes conf/schema/*.json, conf/help/*.txt, and the tables
between the marks.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf
from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from experiments.config.help_text import Option, help_text
from experiments.config.paths import CONF
from experiments.config.settings import (
    AdviceSettings,
    RecordedSettings,
    RunSettings,
    TableSettings,
)
from experiments.config.settings.kinds import MULTIPLE_OF_PI
from experiments.tracking.files import replace_file
from experiments.tracking.trees import flatten

# The file of a command in conf/ to the settings that it makes.
COMMANDS: dict[str, Any] = {
    "config": RunSettings,
    "infer": RecordedSettings,
    "infer_table": TableSettings,
    "advise": AdviceSettings,
}
_GROUPS = (
    "system",
    "truth",
    "grid",
    "inference",
)  # whose files set values of which each command has one
_BOUNDS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
_TYPES = {
    "integer": "whole number",
    "number": "number",
    "string": "word",
    "boolean": "true or false",
    "null": "null",
}


def schema(command: str) -> dict[str, Any]:
    """The JSON schema of a command's config; any value may be left to another file."""
    tree = TypeAdapter(COMMANDS[command]).json_schema(schema_generator=_WithMultiplesOfPi)
    for node in (tree, *tree["$defs"].values()):
        node.pop("required", None)
    for kind in ("SystemSettings", "ShapeSettings", "PredicateSettings"):
        if content := tree["$defs"].get(kind):
            target = {**content["properties"]["target"], "title": "Target"}
            tree["$defs"][kind] = {
                "type": "object",
                "properties": {"_target_": target},
                "additionalProperties": True,  # what the class or function takes
            }
    tree["properties"] |= {"defaults": {"type": "array"}, "hydra": {"type": "object"}}
    return tree


def readme(text: str) -> str:
    """The text of conf/README.md with its tables written anew."""
    common: set[str] = set()
    for command in COMMANDS:
        lines = [_row(option) for option in options(command)]
        shared = [row.split(" | ")[0].removeprefix("| ") for row in lines if row in common]
        new = [row for row in lines if row not in common]
        common.update(lines)
        head = ["| key | meaning | unit | default | values |", "|---|---|---|---|---|"]
        beside = [f"Beside these, as above: {', '.join(shared)}.", ""] if shared else []
        table = "\n".join([*beside, *head, *new])
        mark, end = f"<!-- {command}: written by experiments.config.reference -->", "<!-- end -->"
        pattern = re.compile(f"{re.escape(mark)}\n.*?{re.escape(end)}", re.DOTALL)
        assert pattern.search(text), f"conf/README.md lacks {mark}"
        text = pattern.sub(lambda _, new=f"{mark}\n{table}\n{end}": new, text)  # type: ignore[misc]
    return text


def main() -> None:
    """Write the schemas, the texts and the tables."""
    for command in COMMANDS:
        replace_file(CONF / "schema" / f"{command}.json", schema_bytes(command))
        replace_file(CONF / "help" / f"{command}.txt", help_of(command).encode())
    path = CONF / "README.md"
    replace_file(path, readme(path.read_text()).encode())


def schema_bytes(command: str) -> bytes:
    """The content of a command's file in conf/schema."""
    return (json.dumps(schema(command), indent=2, ensure_ascii=False) + "\n").encode()


class _WithMultiplesOfPi(GenerateJsonSchema):
    """Numbers may be written as multiples of pi."""

    def float_schema(self, schema: Any) -> dict[str, Any]:
        """A number, or words such as "6/5 pi"."""
        words = {"type": "string", "pattern": f"^{MULTIPLE_OF_PI}$"}
        return {"anyOf": [super().float_schema(schema), words]}


def options(command: str) -> list[Option]:
    """Every value that a command takes, in the order of its settings."""
    tree, defaults = schema(command), _defaults(command)

    def options_of(node: dict[str, Any], prefix: str) -> Iterator[Option]:
        for name, field in node["properties"].items():
            key, content = f"{prefix}{name}", _resolved(field, tree)
            if key in ("defaults", "hydra"):
                continue
            if name != "system" and "description" not in field and "properties" in content:
                yield from options_of(content, f"{key}.")
                continue
            yield Option(
                key=key,
                meaning=field["description"],
                unit=field.get("unit", ""),
                default=defaults.get(key, ""),
                values=_values(field, tree),
            )

    return list(options_of(tree, ""))


def _row(option: Option) -> str:
    """An option as a row of a table."""
    cells = (f"`{option.key}`", option.meaning, option.unit, option.default, option.values)
    return f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |"


def help_of(command: str) -> str:
    """What a command says to --help: its own options, then those of the commands before."""
    before = list(COMMANDS)[: list(COMMANDS).index(command)]
    shared = {option for other in before for option in options(other)}
    every = options(command)
    return help_text(
        command,
        own=[option for option in every if option not in shared],
        shared=[option for option in every if option in shared],
    )


def _values(field: dict[str, Any], tree: dict[str, Any]) -> str:
    """What a field of a schema may be, in words."""
    node = _resolved(field, tree)
    if choices := node.get("enum"):
        return " or ".join(f"`{choice}`" for choice in choices)
    if "const" in node:
        return f"`{node['const']}`"
    if several := node.get("anyOf") or node.get("oneOf"):
        each = [_values(one, tree) for one in several if "pattern" not in one]
        return " or ".join(dict.fromkeys(each))
    if node["type"] == "array":
        return f"list of ({_values(node['items'], tree)})"
    if node["type"] == "object":
        others = node["additionalProperties"]
        if isinstance(others, dict):
            return f"{{name: {_values(others, tree)}, ...}}"
        keys = [*node.get("properties", {}), *["..."] * (others is True)]
        return f"{{{', '.join(keys)}}}"
    bounds = [f"{sign} {node[bound]:.16g}" for bound, sign in _BOUNDS.items() if bound in node]
    return " ".join([_TYPES[node["type"]], ", ".join(bounds)]).strip()


def _resolved(field: dict[str, Any], tree: dict[str, Any]) -> dict[str, Any]:
    """A field of a schema, or what it refers to."""
    name = field.get("$ref", "").rpartition("/")[2]
    resolved: dict[str, Any] = tree["$defs"][name] if name else field
    return resolved


def _defaults(command: str) -> dict[str, str]:
    """The default of each key, spelt as in a file, or the group that sets it."""
    spelling: dict[str, str] = {}
    for path in default_files(command):
        values = values_of(path)
        for key, value in {**values, **flatten(values)}.items():
            spelling[key] = f"`{value if isinstance(value, str) else json.dumps(value)}`"
    for group in _GROUPS:
        files = [set(flatten(values_of(path))) for path in sorted((CONF / group).glob("*.yaml"))]
        spelling |= dict.fromkeys(set.intersection(*files), f"by `{group}`")
    spelling |= {"system": "by `system`", "sampled.use": "by `model`"}
    return {key: "to be given" if value == "`???`" else value for key, value in spelling.items()}


def default_files(command: str) -> list[Path]:
    """The files that hold a command's defaults: its own, and those of conf/base that it names."""
    entries = OmegaConf.to_container(OmegaConf.load(CONF / f"{command}.yaml"))["defaults"]  # type: ignore[index,call-overload]
    base = [entry for entry in entries if isinstance(entry, str) and entry != "_self_"]
    return [CONF / f"{name}.yaml" for name in (command, *base)]


@cache
def values_of(path: Path) -> dict[str, Any]:
    """The values that a file of conf/ sets, by their full keys."""
    tree: Any = OmegaConf.to_container(OmegaConf.load(path))
    values = {key: value for key, value in tree.items() if key not in ("defaults", "hydra")}
    is_global = path.parent == CONF or "# @package _global_" in path.read_text()
    return values if is_global else {path.parent.name: values}


if __name__ == "__main__":
    main()
