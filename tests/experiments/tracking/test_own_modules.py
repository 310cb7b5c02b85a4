"""Modules of the current folder: found if a config names them, and not otherwise."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hand_made import hand_made

from experiments.config.paths import CHECKOUT
from experiments.tracking.own_modules import on_path, put_on_path
from experiments.tracking.study import write_plan


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a module and a package, out of the path."""
    (tmp_path / "mine_alone.py").write_text("")
    (tmp_path / "my_package").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != ""])
    return tmp_path


@pytest.mark.parametrize(
    ("name", "is_put"),
    [
        ("mine_alone.Mine", True),
        ("my_package.inner.Mine", True),
        ("mlci.systems.Pendulum", False),
        ("json.JSONDecoder", False),
        ("nowhere_at_all.Mine", False),
        ("../mine_alone.Mine", False),
        ("", False),
    ],
)
def test_folder_joins_the_path_for_a_module_in_it(name: str, is_put: bool, folder: Path) -> None:
    (folder / "json.py").write_text("")
    before = list(sys.path)
    with on_path(name):
        assert sys.path == before + [str(folder)] * is_put
    assert sys.path == before
    put_on_path(name)
    put_on_path(name)
    assert sys.path == before + [str(folder)] * is_put
    assert (importlib.util.find_spec("mine_alone") is not None) == is_put


def test_looking_back_runs_nothing_of_the_current_folder(tmp_path: Path) -> None:
    """Pandas looks for numexpr, which is not installed."""
    point = hand_made(tmp_path / "results")
    write_plan(tmp_path / "results" / "s", [(point, ["seed=0"])])
    for name in ("numexpr", "bottleneck", "tqdm", "numba"):
        (tmp_path / f"{name}.py").write_text("open('ran', 'w')\n")
    command = [sys.executable, str(CHECKOUT / "experiments" / "results.py")]
    for words in (["export", "s"], ["status"]):
        done = subprocess.run(
            [*command, *words],
            cwd=tmp_path,
            env={key: value for key, value in os.environ.items() if key != "PYTHONPATH"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
    assert not (tmp_path / "ran").exists()
