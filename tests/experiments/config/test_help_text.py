"""Texts of --help: made from the settings, within 80 columns, and what commands say at once."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from commands import run_here

import mlci
from experiments import app
from experiments.config.paths import CHECKOUT, CONF
from experiments.config.reference import COMMANDS, help_of, options
from experiments.terminal import WIDTH

MAINS = {"config": app.run, "infer": app.infer, "infer_table": app.infer, "advise": app.advise}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_told_with_unit_and_default_within_the_terminal(command: str) -> None:
    text = help_of(command)
    written = (CONF / "help" / f"{command}.txt").read_text(encoding="utf-8")
    assert written == text, "run python -m experiments.config.reference"
    assert max(map(len, text.splitlines())) <= WIDTH
    for option in options(command):
        assert re.search(rf"^  {re.escape(option.key)}( |$)", text, re.MULTILINE), option
    assert len(re.findall(r"^  python experiments/\w+\.py", text, re.MULTILINE)) == 3


def test_a_line_has_meaning_unit_choices_and_default() -> None:
    words = " ".join(help_of("config").split())
    assert "dt time step of the tabular model; it divides the horizon [s] (default 0.25)" in words
    assert "demonstrations.integrator steps of the simulation" in words
    assert ": euler or rk4 (default euler)" in words
    assert "(set by system)" in words
    assert "demonstrations a folder, a glob pattern" in " ".join(help_of("infer").split())


@pytest.mark.parametrize("command", COMMANDS)
def test_help_and_version_need_nothing_that_takes_time(command: str, tmp_path: Path) -> None:
    nonsense = "table=nonsense" if command == "infer_table" else "dt=nonsense"
    done = run_here(MAINS[command], nonsense, "--help", folder=tmp_path)
    assert (done.returncode, done.stdout) == (0, help_of(command))
    done = run_here(MAINS[command], "--version", folder=tmp_path)
    assert done.returncode == 0
    assert re.fullmatch(rf"mlci {mlci.__version__}( \(commit \w+.*\))?\n", done.stdout)


@pytest.mark.parametrize("words", [["infer.py", "--help"], ["run.py", "--version"], ["results.py"]])
def test_the_start_loads_no_pandas_scipy_or_hydra(words: list[str], tmp_path: Path) -> None:
    name, *options = words
    code = (
        "import runpy, sys\n"
        f"sys.argv = {[name, *(options or ['status', '--results', str(tmp_path)])]!r}\n"
        "try:\n"
        f"    runpy.run_path({str(CHECKOUT / 'experiments' / name)!r}, run_name='__main__')\n"
        "except SystemExit as stop:\n"
        "    assert not stop.code, stop.code\n"
        "slow = {'numpy', 'pandas', 'scipy', 'hydra', 'pydantic'} & set(sys.modules)\n"
        "assert not slow, slow\n"
    )
    assert CHECKOUT is not None
    subprocess.run([sys.executable, "-c", code], check=True, cwd=CHECKOUT, timeout=600)
