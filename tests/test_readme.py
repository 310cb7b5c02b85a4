"""Every README: its code runs as written, its commands run, its links lead to files that exist."""

from __future__ import annotations

import ast
import importlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from figure_study import measure_rows
from markdown_it import MarkdownIt
from sybil import Document, Example
from sybil.evaluators.python import PythonEvaluator
from sybil.parsers.markdown import CodeBlockParser

import mlci
from mlci.simulate import rollout
from mlci.systems import Pendulum

ROOT = Path(__file__).resolve().parents[1]
CODE = ("conf", "experiments", "mlci", "paper_figures")
READMES = [
    *ROOT.glob("README.md"),
    *ROOT.glob("[!.]*/README.md"),
    *(path for folder in CODE for path in ROOT.glob(f"{folder}/*/**/README.md")),
]

# What is done in place of a command that takes long, or wants a network. A command that no pattern
# matches runs as it is written.
SHORT = [
    (r"^make (\w+)", r"make -n \1"),
    (r"^pip install 'mlci\[(\w+)\]'", r"grep '^\1 = ' pyproject.toml"),
    (r"^(python -m paper_figures( [a-z ]+)?)$", r"\1 --jobs 1"),
    (
        r"^(mlci-run .*subject=unicycle.*)",
        r"\1 scale=smoke grid.shape=[8,8,8] safety.shape=[21,21,12]",
    ),
    (r"^(mlci-figures .*)", r"\1 --jobs 1"),
    (r"experiment=paper", r"experiment=in_cell"),
    (r"^(?!.*scale=smoke)(.*run(\.py)? -m .*)", r"\1 scale=smoke sweep.dry_run=true"),
    (r"^(?!.*scale=smoke)(.*run(\.py)?( .*)?)$", r"\1 scale=smoke"),
]


def short(command: str) -> str:
    """A command, or what is done in its place."""
    for pattern, replacement in SHORT:
        command = re.sub(pattern, replacement, command)
    return with_identities(command)


def with_identities(command: str) -> str:
    """A command whose identities of points are those of points in this folder, in their order."""
    identities = iter(sorted(path.name for path in Path("results", "points").glob("*")))
    return re.sub(r"\b[0-9a-f]{6}\b", lambda _: next(identities)[:6], command)


def run_commands(example: Example) -> None:
    """Runs a block of commands in the current folder; the first that fails is told."""
    block = example.parsed.replace("\\\n", " ")
    commands = [re.sub(r"\s+#\s.*", "", line).strip() for line in block.splitlines()]
    done = subprocess.run(
        ["bash", "-ex"],
        input="\n".join(map(short, commands)),
        env={
            **os.environ,
            "PATH": os.pathsep.join([*example.namespace["programs"], os.environ["PATH"]]),
            "PYTHONPATH": str(example.namespace["checkout"]),
        },
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, f"{example.path}, line {example.line}:\n{done.stderr}"


def write_file(example: Example) -> None:
    """Writes a block to the file that the text before it names: in `name.py`:"""
    before = example.document.text[: example.region.start]
    if name := re.search(r"`(\S+\.(?:py|yaml))`:\s*$", before):
        path = Path(name[1])
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(example.parsed)


def run_python(example: Example) -> None:
    write_file(example)
    PythonEvaluator()(example)


def read_yaml(example: Example) -> None:
    write_file(example)
    yaml.safe_load(example.parsed)


def show(example: Example) -> None:
    """What a command prints, or a picture in letters: nothing to run."""


KINDS = {"bash": run_commands, "python": run_python, "yaml": read_yaml, "text": show}


def name(readme: Path) -> str:
    return readme.relative_to(ROOT).as_posix()


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The current folder: a copy of the checkout, with recordings and few results."""
    copy = tmp_path / "checkout"
    for folder in CODE:
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("Makefile", "pyproject.toml", "requirements.lock"):
        shutil.copy(ROOT / file, copy)
    (copy / ".venv").symlink_to(sys.prefix)
    (copy / "cluster").mkdir()
    (copy / "cluster" / "sbatch").touch(mode=0o755)  # as if there were a SLURM cluster
    (copy / "recorded").mkdir()
    for start in (0.5, 1.0):  # of a pendulum, and of a vehicle that drives along x
        time = np.arange(501) * 0.01
        path = rollout(Pendulum(), [start, 0.0], np.zeros((500, 1)), 0.01)
        drive = {"x": 0.3 * time - start, "y": start, "heading": 0.0}
        table = pd.DataFrame({"time": time, "angle": path[:, 0], "angular_velocity": path[:, 1]})
        table.assign(**drive).to_csv(copy / "recorded" / f"from_{start}.csv", index=False)
    for study in ("paper", "telescope"):  # made-up tables, for what is drawn from tables alone
        tables = copy / "results" / study / "tables"
        tables.mkdir(parents=True)
        measure_rows().to_csv(tables / "measures.csv", index=False)
    monkeypatch.chdir(copy)
    return copy


@pytest.mark.parametrize("readme", READMES, ids=name)
def test_code_and_commands_run(readme: Path, checkout: Path) -> None:
    parsers = [CodeBlockParser(kind, evaluate) for kind, evaluate in KINDS.items()]
    document = Document.parse(str(readme), *parsers)
    programs = [str(Path(sys.executable).parent), str(checkout / "cluster")]
    document.namespace.update(checkout=checkout, programs=programs)
    for example in document:
        example.evaluate()


@pytest.mark.parametrize("readme", READMES, ids=name)
def test_every_block_says_what_it_is(readme: Path) -> None:
    """A fence names its language, and none is of a kind that nobody runs."""
    tokens = MarkdownIt().parse(readme.read_text())
    assert not [token.map for token in tokens if token.type == "code_block"]
    assert {token.info for token in tokens if token.type == "fence"} <= KINDS.keys()


@pytest.mark.parametrize("readme", READMES, ids=name)
def test_links_lead_to_files_and_sections_that_exist(readme: Path) -> None:
    """Apart from other sites, and from results of studies, which need not have run."""
    for target in re.findall(r"\]\(([^)\s]+)\)", readme.read_text()):
        path, _, section = target.partition("#")
        file = (readme.parent / path).resolve() if path else readme
        is_a_studys = file.is_relative_to(ROOT / "results") and file.name != "README.md"
        if "://" in target or is_a_studys:
            continue
        assert file.exists(), target
        if section:
            titles = re.findall(r"^#+ (.*)$", file.read_text(), flags=re.MULTILINE)
            anchors = {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}
            assert section in anchors, target


def equation_map() -> str:
    """The section of the library's README that says where each equation lives."""
    text = (ROOT / "mlci" / "README.md").read_text()
    return text.split("## Where each equation lives")[1].split("\n## ")[0]


def test_the_equation_map_names_every_equation() -> None:
    section = equation_map()
    for number in (1, 2, 3, 7, 8, 9, 10, 11, 12):
        assert f"({number})" in section
    assert "(4)-(6)" in section


def test_every_name_of_the_equation_map_exists_and_is_described() -> None:
    names = re.findall(r"`(mlci\.[\w.]+)`", equation_map())
    assert len(names) > 15
    for name in names:
        module, *attributes = name.removeprefix("mlci.").split(".")
        value = importlib.import_module(f"mlci.{module}")
        for attribute in attributes:
            value = getattr(value, attribute)
        assert value.__doc__, name


def test_the_names_of_the_library_are_listed_once_each() -> None:
    section = (ROOT / "mlci" / "README.md").read_text().split("## The names")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (`.*?) \|", section, flags=re.MULTILINE)
    names = re.findall(r"`(\w+)`", " ".join(rows))
    assert sorted(names) == sorted(mlci.__all__)
    assert all(getattr(mlci, name).__doc__ for name in names)
    assert len(section.splitlines()) < 30


def test_the_shortest_way_is_as_short_as_it_says() -> None:
    """One import, eight statements, and the printed ranking is that of the README."""
    text = (ROOT / "mlci" / "README.md").read_text()
    code = re.search(r"```python\n(.*?)```", text, flags=re.DOTALL)
    shown = re.search(r"```text\n(.*?)```", text, flags=re.DOTALL)
    assert code is not None
    assert shown is not None
    first, *statements = ast.parse(code[1]).body
    assert isinstance(first, ast.Import)
    assert len(statements) <= 8
    names: dict[str, object] = {}
    exec(code[1], names)
    assert repr(names["inference"]).split() == shown[1].split()
