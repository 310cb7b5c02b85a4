"""Every README: its code runs as written, its commands run, its links lead to files that exist."""

from __future__ import annotations

import ast
import os
import pkgutil
import re
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from commands import run_here
from figure_study import study_tables
from markdown_it import MarkdownIt
from sybil import Document, Example
from sybil.evaluators.python import PythonEvaluator
from sybil.parsers.markdown import CodeBlockParser

import mlci
from experiments import advise, infer, results, run
from experiments.field import __main__ as field
from mlci.simulate import rollout
from mlci.systems import Pendulum
from paper_figures import __main__ as figures
from paper_figures import state_space
from paper_figures.report import __main__ as report

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
    (r"^(git clone|cd mlci|xdg-open) ?.*", "true"),
    (r"^\.venv/bin/python (.*)=FOLDER", r"python \1=recorded"),
    (r"^pip install \.$", "test -e pyproject.toml"),  # as tests/stress/wheel.sh does
    (r"^pip install (?:-e )?'\.\[(\w+)\]'", r"grep '^\1 = ' pyproject.toml"),
    (r"^(python -m paper_figures( [a-z ]+)?)( --jobs 2)?$", r"\1 --jobs 1"),
    # These are run, and what they make is looked at, in experiments/config/test_own_system.py.
    (r"^mlci-.* ?forklift.*", "true"),
    (r"experiment=paper", r"experiment=in_cell"),
    (r"^(?!.*scale=smoke)(.*run\.py -m .*)", r"\1 scale=smoke sweep.dry_run=true"),
    (r"^(?!.*scale=smoke)(.*run\.py( .*)?)$", r"\1 scale=smoke"),
    (r"^(.*run\.py .*)", r"\1 workers=1"),
    # Two hundred simulated demonstrators a command are for the tests of calibration.
    (r"^(?!.*inference)(.*(run|infer)\.py .*)", r"\1 inference.calibrate=false"),
    # A minute of grids and time steps is for tests/experiments/test_advise.py.
    (r"^(.*advise\.py)$", r"\1 budget=400 dts=[0.25] pairs=10"),
    # Nor are minutes of sampled paths for the tasks that may be recorded next.
    (r"^(.*model=sampled.*)", r"\1 sampled.samples=200 sampled.restarts=1 next_tasks.count=0"),
]
# Commands that run here, as starting each of them takes a second or two.
MAINS = {
    "experiments/run.py": run.main,
    "experiments/infer.py": infer.main,
    "experiments/advise.py": advise.main,
    "experiments/results.py": results.main,
    "experiments.field": field.main,
    "paper_figures": figures.main,
    "paper_figures.report": report.main,
}


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
    for line in example.parsed.replace("\\\n", " ").splitlines():
        command = short(re.sub(r"\s+#\s.*", "", line).strip())
        words = [word for word in shlex.split(command) if word != "-m" or "run.py" in command]
        if words[:1] == ["python"]:
            done = run_here(MAINS[words[1]], *words[2:], folder=Path.cwd())
        else:
            done = subprocess.run(
                ["bash", "-c", command], capture_output=True, text=True, timeout=600
            )
        assert done.returncode == 0, f"{example.path}, line {example.line}, {line}:\n{done.stderr}"


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
def folder(readme: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The current folder, with recordings, few results, and what some commands look for."""
    for file in ("Makefile", "pyproject.toml", "requirements.lock"):
        shutil.copy(ROOT / file, tmp_path)
    (tmp_path / ".venv").symlink_to(sys.prefix)
    (tmp_path / "cluster").mkdir()
    (tmp_path / "cluster" / "sbatch").touch(mode=0o755)  # as if there were a SLURM cluster
    monkeypatch.setenv("PATH", str(tmp_path / "cluster"), prepend=os.pathsep)
    (tmp_path / "recorded").mkdir()
    for start in (0.5, 1.0):  # of a pendulum, and of a vehicle that drives along x
        time = np.arange(501) * 0.01
        path = rollout(Pendulum(), [start, 0.0], np.zeros((500, 1)), 0.01)
        drive = {"x": 0.3 * time - start, "y": start, "heading": 0.0}
        table = pd.DataFrame({"time": time, "angle": path[:, 0], "angular_velocity": path[:, 1]})
        table.assign(**drive).to_csv(tmp_path / "recorded" / f"from_{start}.csv", index=False)
    # Made-up tables, for what is drawn from tables alone; cleaning refuses such a study.
    for study in ("paper", "telescope") if readme.parent.name == "paper_figures" else ():
        tables = tmp_path / "results" / study / "tables"
        tables.mkdir(parents=True)
        for name in state_space.TABLES:
            study_tables()[name].to_csv(tables / f"{name}.csv", index=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    usual = signal.getsignal(signal.SIGTERM)
    yield tmp_path
    signal.signal(signal.SIGTERM, usual)
    for module in tmp_path.glob("*.py"):
        sys.modules.pop(module.stem, None)


@pytest.mark.parametrize("readme", READMES, ids=name)
@pytest.mark.usefixtures("folder")
def test_code_and_commands_run(readme: Path) -> None:
    parsers = [CodeBlockParser(kind, evaluate) for kind, evaluate in KINDS.items()]
    for example in Document.parse(str(readme), *parsers):
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
        assert pkgutil.resolve_name(name).__doc__, name


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
