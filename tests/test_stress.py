"""What `make stress` runs names files and functions that exist; most changes do not run it."""

import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted((ROOT / "tests" / "stress").glob("[!_]*.*"))
PATH = r"\b(?:tests|experiments|mlci|paper_figures|conf)/[\w/]+(?:\.[a-z0-9]+)?"


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_files_that_a_stress_file_names_exist(file: Path) -> None:
    names = re.findall(PATH, file.read_text())
    assert [name for name in names if not (ROOT / name).exists()] == []


def test_the_test_files_of_another_hydra_are_named() -> None:
    names = re.findall(PATH, (ROOT / "tests" / "stress" / "hydra14.sh").read_text())
    assert len([name for name in names if name.startswith("tests/")]) >= 4


@pytest.mark.parametrize(
    "file", [file for file in FILES if file.suffix == ".py"], ids=lambda file: file.name
)
def test_what_a_stress_file_imports_exists(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(file.parent), *sys.path])  # as if it were run
    assert callable(runpy.run_path(str(file), run_name="imported")["main"])
