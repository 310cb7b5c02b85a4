"""What status names after one edit of the code: what that code makes, and nothing else."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tampering import pristine

from experiments.config.paths import CHECKOUT

POINTS = "the code that computes points, or a package that it uses, has changed since"


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout with results whose points were left elsewhere."""
    assert CHECKOUT is not None
    clone = tmp_path_factory.mktemp("clone")
    for name in ("experiments", "mlci", "paper_figures", "conf"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(CHECKOUT / name, clone / name, ignore=ignored)
    shutil.copy(CHECKOUT / "pyproject.toml", clone)
    pristine(clone / "elsewhere").rename(clone / "results")
    shutil.rmtree(clone / "results" / "points")
    return clone


def status(clone: Path) -> dict[str, str]:
    """What `status` says of tables, figure and report of the study `paper`."""
    command = [sys.executable, "experiments/results.py", "status", "paper"]
    environ = {**os.environ, "PYTHONPATH": str(clone)}
    done = subprocess.run(command, cwd=clone, env=environ, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    first, *lines = done.stdout.splitlines()
    assert first == "paper: 2 points: 2 shipped"
    return {line.split()[0]: line.split(maxsplit=1)[1] for line in lines}


@pytest.mark.parametrize(
    ("file", "stale"),
    [
        (None, {}),
        ("experiments/console.py", {}),
        ("mlci/maxent.py", {"tables": POINTS, "figure": POINTS}),
        ("experiments/point/tables.py", {"tables": POINTS, "figure": POINTS}),
        ("experiments/collate/intervals.py", {"tables": "the code that makes them of points"}),
        ("paper_figures/state_space.py", {"figure": "the code that draws has changed since"}),
        ("paper_figures/report/claim_3.py", {"report": "the code that writes it has changed"}),
    ],
)
def test_an_edit_makes_stale_what_it_makes(
    file: str | None, stale: dict[str, str], clone: Path
) -> None:
    before = None if file is None else (clone / file).read_text()
    if file is not None:
        (clone / file).write_text(f"{before}\nEDITED = True\n")
    try:
        lines = status(clone)
    finally:
        if file is not None:
            (clone / file).write_text(before)
    assert set(lines) == {"tables", "figure", "report"}
    for name, text in lines.items():
        if name in stale:
            assert "not up to date: " in text
            assert stale[name] in text
        else:
            assert text.endswith("shipped, unchanged")
