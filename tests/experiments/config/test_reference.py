"""What is written from the settings is up to date; conf/ and the settings tell the same keys."""

from __future__ import annotations

import json
import re
from itertools import combinations

import pytest
from pydantic import TypeAdapter
from tiny_point import composed

from experiments.config.paths import CONF
from experiments.config.problems import field_keys
from experiments.config.reference import (
    COMMANDS,
    default_files,
    readme,
    schema,
    schema_bytes,
    values_of,
)
from experiments.config.settings.kinds import MULTIPLE_OF_PI
from experiments.tracking.trees import flatten

STALE = "run python -m experiments.config.reference"


@pytest.mark.parametrize("command", COMMANDS)
def test_schemas_are_up_to_date(command: str) -> None:
    path = CONF / "schema" / f"{command}.json"
    assert path.read_bytes() == schema_bytes(command), STALE
    first = (CONF / f"{command}.yaml").read_text().splitlines()[0]
    assert first == f"# yaml-language-server: $schema=schema/{command}.json"


def test_tables_are_up_to_date() -> None:
    text = (CONF / "README.md").read_text()
    assert readme(text) == text, STALE


def test_tables_have_a_row_for_every_value_with_its_unit_and_default() -> None:
    text = (CONF / "README.md").read_text()
    for command, kind in COMMANDS.items():
        for key in field_keys(kind):
            is_group = any(other.startswith(f"{key}.") for other in field_keys(kind))
            kinds = ("boxes", "balls", "half_spaces", "shapes")
            lists = [f"{group}.{of}." for group in ("truth", "hypotheses") for of in kinds]
            lists += ["truth.controls.", "hypotheses.controls.ranges."]
            inside = key.startswith((*lists, "goal.", "next_tasks.box."))
            if not is_group and not inside:
                assert f"| `{key}` | " in text, (command, key)
    row = next(line for line in text.splitlines() if line.startswith("| `dt` | "))
    assert row.endswith(" | s | `0.25` | number > 0 |")
    assert "| `safety.method` | " in text
    assert "| `equation` | `equation` or `escapes` or `barrier` |" in text


@pytest.mark.parametrize("command", COMMANDS)
def test_every_default_stands_once(command: str) -> None:
    files = {path: set(flatten(values_of(path))) for path in default_files(command)}
    for one, other in combinations(files, 2):
        assert not files[one] & files[other], (one, other)


def test_no_shared_value_stands_in_a_command_too() -> None:
    """What two commands have in common is in conf/base."""
    names = {command: flatten(values_of(CONF / f"{command}.yaml")) for command in COMMANDS}
    # Each has a meaning of its own: a group of run.py, and what infer.py prints.
    for one, other in combinations(names, 2):
        assert not names[one].keys() & names[other].keys()


@pytest.mark.parametrize("command", COMMANDS)
def test_conf_holds_every_key_of_the_settings(command: str) -> None:
    words = ["demonstrations=x.csv"] if command.startswith("infer") else []
    words += ["table=x.yaml"] if command == "infer_table" else []
    tree = composed(*words, name=command)
    assert set(schema(command)["properties"]) - {"defaults", "hydra"} <= set(tree)


def test_schema_takes_multiples_of_pi_and_keeps_ranges() -> None:
    number, words = schema("config")["properties"]["dt"]["anyOf"]
    assert number == {"type": "number", "exclusiveMinimum": 0}
    assert re.fullmatch(words["pattern"], "6/5 pi")
    assert not re.fullmatch(words["pattern"], "fast")
    assert words["pattern"] == f"^{MULTIPLE_OF_PI}$"
    assert schema("config")["properties"]["dt"]["unit"] == "s"


def test_schema_refuses_unknown_keys_but_not_arguments_of_a_system() -> None:
    tree = schema("config")
    assert tree["additionalProperties"] is False
    assert tree["$defs"]["GridSettings"]["additionalProperties"] is False
    assert tree["$defs"]["SystemSettings"]["additionalProperties"] is True
    assert "required" not in json.dumps(tree)


def test_mark_that_is_gone_is_noticed() -> None:
    with pytest.raises(AssertionError, match=r"conf/README\.md lacks <!-- config"):
        readme("nothing")


def test_every_field_says_what_it_means() -> None:
    for kind in COMMANDS.values():
        tree = TypeAdapter(kind).json_schema()
        for node in (tree, *tree["$defs"].values()):
            for name, field in node["properties"].items():
                group = tree["$defs"].get(field.get("$ref", "").rpartition("/")[2], {})
                assert "description" in field or group.get("properties"), name
