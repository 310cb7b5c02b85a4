"""The own system of conf/README.md, in a folder of its own, and what is refused about others."""

import re
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest
from commands import run_here
from refusals import refusal
from tiny_point import composed

from experiments import advise, infer, results, run
from experiments.config.paths import CHECKOUT, CONF
from experiments.config.read import read_config
from experiments.config.settings.system import read_system
from experiments.tracking import sources
from experiments.tracking.points import Point
from experiments.tracking.trees import canonical_json
from paper_figures import __main__ as figures

SECTION = (CONF / "README.md").read_text().split("\n## Your own system\n")[1]
# A module, a config, and the commands.
BLOCKS = re.findall(r"^```\w+\n(.*?)^```", SECTION, flags=re.MULTILINE | re.DOTALL)
MAINS = {
    "mlci-run": run.main,
    "mlci-infer": infer.main,
    "mlci-advise": advise.main,
    "mlci-figures": figures.main,
    "mlci-results": results.main,
}

SMALL = ["grid.shape=[8,8,8]"]
SMOKE = {
    "mlci-run": [
        *("scale=smoke", "safety.shape=[21,21,12]", "workers=1", "inference.calibrate=false"),
        *SMALL,
    ],
    "mlci-infer": [*SMALL, "inference.calibrate=false"],
    "mlci-advise": [*SMALL, "grids=[[8,8,8]]", "dts=[1.0]", "pairs=4", "remedy=1"],
    "mlci-figures": ["--jobs", "1"],
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with the README's two files; it is not in the path until a config names a module."""
    module, config, _ = BLOCKS
    (tmp_path / "forklift.py").write_text(module)
    (tmp_path / "conf" / "subject").mkdir(parents=True)
    (tmp_path / "conf" / "subject" / "forklift.yaml").write_text(config)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    sys.modules.pop("forklift", None)


def command(folder: Path, line: str) -> tuple[int, str, str]:
    """Exit status, output and errors of a command of the README, at a small scale.

    It runs here, as starting it takes a second or two; what the folder holds is read anew.
    """
    name, *words = line.split()
    sys.modules.pop("forklift", None)
    for cached in sources.CACHES:
        cached.cache_clear()
    usual = signal.getsignal(signal.SIGTERM)
    try:
        done = run_here(MAINS[name], *words, *SMOKE.get(name, []), folder=folder)
    finally:
        signal.signal(signal.SIGTERM, usual)
    return done.returncode, done.stdout, done.stderr


def test_example_is_short_and_not_ours() -> None:
    assert sum(len(block.splitlines()) for block in BLOCKS) < 60
    assert not list(CHECKOUT.glob("mlci/**/*forklift*"))


def test_every_command_works_in_a_folder_of_its_own(folder: Path) -> None:
    one, sweep, draw, rank = BLOCKS[2].splitlines()
    status, out, err = command(folder, one)
    assert status == 0, err
    assert f"written: {folder}/results/points/" in out
    status, out, err = command(folder, sweep)
    assert status == 0, err
    assert "2 points: 1 done, 1 missing; 1 to run" in out
    tables = folder / "results" / "forklift" / "tables"
    assert set(pd.read_csv(tables / "summary.csv")["actions"]) == {"3x5"}
    status, out, err = command(folder, draw)
    assert status == 0, err
    assert (folder / "results" / "forklift" / "figures" / "hypothesis_map_pillar.pdf").is_file()

    paths = pd.read_csv(tables / "paths.csv")
    (folder / "recorded").mkdir()
    for number, path in paths.groupby("demonstration"):
        recorded = path[["time", "x", "y", "heading"]]
        recorded.to_csv(folder / "recorded" / f"{number}.csv", index=False)
    status, out, err = command(folder, rank)
    assert status == 0, err
    assert f"{paths['demonstration'].nunique()} used, 0 files not used" in out
    assert re.search(r" x .* m, y .* m$", out, flags=re.MULTILINE)
    status, out, err = command(folder, "mlci-advise subject=forklift")
    assert "8x8x8" in out, err
    assert sorted(path.name for path in folder.iterdir() if path.name != "__pycache__") == [
        *("conf", "forklift.py", "recorded", "results")
    ]

    module = folder / "forklift.py"
    module.write_text(module.read_text() + "\nEDITED = True\n")
    status, out, err = command(folder, f"{sweep} sweep.dry_run=true")
    assert "2 points: 2 stale; 2 to run" in out
    assert "2 stale" in " ".join(command(folder, "mlci-results status forklift")[1].split())


def test_source_counts_what_a_module_imports_from_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "mine_own.py").write_text("import numpy\nimport beside_it\n")
    hashes = []
    for helper, other in (("a = 1", "b = 1"), ("a = 2", "b = 1"), ("a = 2", "b = 2")):
        (tmp_path / "beside_it.py").write_text(helper)
        (tmp_path / "not_imported.py").write_text(other)
        for cached in sources.CACHES:
            cached.cache_clear()
        hashes.append(Point.planned({"system": {"target": "mine_own.Mine"}}, tmp_path).source)
    assert hashes[0] != hashes[1] == hashes[2]


def test_folder_whose_config_hides_behind_ours_is_refused(folder: Path) -> None:
    (folder / "conf" / "truth").mkdir()
    (folder / "conf" / "truth" / "c1.yaml").write_text("name: c1\n")
    status, _, err = command(folder, "mlci-run subject=forklift")
    assert status == 2
    assert "conf/truth/c1.yaml: mlci comes with a truth/c1 of its own; rename this file" in err
    assert len(err.splitlines()) == 1


MINE = """
from dataclasses import dataclass
from typing import Any
import numpy as np
from mlci.systems import DoubleIntegrator, System
class Half(System):
    def dynamics(self, states, controls):
        return states
class Scalar(DoubleIntegrator):
    def dynamics(self, states, controls):
        return states[0]
class Hinted(DoubleIntegrator):
    def __init__(self, limit: "Nowhere" = 1.0):
        super().__init__()
class Broken(DoubleIntegrator):
    def __init__(self):
        {}["key"]
class Loose(DoubleIntegrator):
    def __init__(self, size=2, more=(), any_more: "Any" = None):
        super().__init__()
class Wheel(DoubleIntegrator):
    def dynamics(self, states, controls):
        return super().dynamics(states, np.cos(3 * controls))
    jacobians = System.jacobians
"""
REFUSED = {
    "system._target_=mine.Half": "system._target_: 'mine.Half' does not define control_box, space",
    "system._target_=mine.Full": "system._target_: 'mine.Full' cannot be imported: {}/mine.py "
    "defines no Full",
    "system._target_=mime.Full": "'mime.Full' cannot be imported: there is no module mime in {}, "
    "nor installed",
    "system._target_=bad.Bad": "'bad.Bad' cannot be imported: {}/bad.py, line 2: NameError: name "
    "'nump' is not defined",
    "system._target_=worse.Bad": "'worse.Bad' cannot be imported: SyntaxError: '(' was never "
    "closed (worse.py, line 1)",
    "system._target_=mine.Hinted": "system._target_: type hints of Hinted cannot be read: name "
    "'Nowhere' is not defined",
    "system._target_=mine.Broken": "system: Broken fails: KeyError: 'key'",
    "system._target_=mine.Scalar": "system: Scalar.dynamics must be (7, 5, 2) for states (7, 1, 2) "
    "and controls (5, 1), not (1, 2)",
    "subject=forklift": "subject=forklift: there is no {}/conf/subject/forklift.yaml",
    "--config-dir=nowhere": "Additional config directory '{}/nowhere' not found",
}


@pytest.mark.parametrize("argument", REFUSED)
def test_wrong_system_is_refused(
    argument: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    (tmp_path / "bad.py").write_text("# Edit me.\nx = nump.pi\n")
    (tmp_path / "worse.py").write_text("x = (\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("mine", "bad", "worse"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    own = [f"~system.{key}" for key in composed()["system"] if key != "_target_"]
    words = [argument, *(own if "_target_" in argument else [])]
    said = refusal(words, monkeypatch, capsys)
    assert REFUSED[argument].replace("{}", str(tmp_path)) in said
    assert len(said.splitlines()) == 1


def test_word_that_a_subject_overrules_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refusal(["subject=forklift", "truth=c1"], monkeypatch, capsys)
    assert "truth=c1: a subject brings its own; change values, such as grid.shape" in said


def test_dynamics_that_are_not_affine_are_refused_with_a_truth_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    words = ["system=double_integrator", "system._target_=mine.Wheel"]
    said = refusal([*words, "truth=wall"], monkeypatch, capsys)
    assert "truth: wall needs a safe set, but Wheel.dynamics is not affine in the control" in said
    assert said.rstrip().endswith("as the control; or take truth=none")
    read_config(composed(*words, "truth=none"))


def test_equal_numbers_are_one_even_without_a_type_hint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    target = {"_target_": "mine.Loose"}
    one = read_system({**target, "size": 2.0, "more": [1, -0.0], "any_more": 4})
    other = read_system({**target, "more": [1.0, 0], "any_more": 4.0})
    assert canonical_json(one) == canonical_json(other)
    assert canonical_json(read_system({**target, "size": 2.5})) != canonical_json(other)
    assert isinstance(read_system({**target, "size": 1e300}).arguments["size"], float)
