"""The README's promises that a machine can check."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

README = (Path(__file__).resolve().parents[1] / "README.md").read_text()
MAP = README.split("## Where each equation lives")[1].split("\n## ")[0]
NAMES = re.findall(r"`(mlci\.[\w.]+)`", MAP)


def test_the_equation_map_is_there() -> None:
    for number in (1, 2, 3, 7, 8, 9, 10, 11, 12):
        assert f"({number})" in MAP
    assert "(4)-(6)" in MAP


@pytest.mark.parametrize("name", sorted(set(NAMES)))
def test_every_name_of_the_equation_map_exists(name: str) -> None:
    parts = name.split(".")
    found = importlib.import_module(".".join(parts[:2]))
    for part in parts[2:]:
        found = getattr(found, part)
    assert found.__doc__


def test_every_command_of_the_readme_names_files_that_exist() -> None:
    root = Path(__file__).resolve().parents[1]
    for path in re.findall(r"(?:python |`)((?:experiments|conf|mlci)/[\w/.]+)", README):
        assert (root / path).exists(), path
    targets = (root / "Makefile").read_text()
    for target in re.findall(r"^    make (\w+)", README, flags=re.MULTILINE):
        assert re.search(rf"^{target}:", targets, flags=re.MULTILINE), target


def test_the_examples_run(capsys: pytest.CaptureFixture[str]) -> None:
    """Every block of Python, each in a module of its own."""
    examples = re.findall(r"^```python\n(.*?)^```", README, flags=re.MULTILINE | re.DOTALL)
    assert examples
    for example in examples:
        exec(compile(example, "README.md", "exec"), {})
    assert "Box(lower=" in capsys.readouterr().out
