"""What a record says about code and machine, and the memory that a point needed."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from experiments.tracking import environment


def test_peak_memory_is_that_of_the_point_alone() -> None:
    if not Path("/proc/self/clear_refs").exists():
        pytest.skip("this system does not forget peaks")
    big = np.ones(50_000_000)
    assert environment.peak_memory() > big.nbytes // 1024**2
    del big
    environment.reset_peak_memory()
    before = environment.peak_memory()
    big = np.ones(25_000_000)
    assert environment.peak_memory() - before == pytest.approx(big.nbytes / 1024**2, abs=20)


def test_changes_since_the_commit_are_kept_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkout, results = tmp_path / "checkout", tmp_path / "results"
    (checkout / "results").mkdir(parents=True)

    def git(*arguments: str) -> None:
        author = ["-c", "user.name=n", "-c", "user.email=e"]
        subprocess.run(["git", *author, *arguments], cwd=checkout, check=True, capture_output=True)

    def state() -> dict:
        environment._git_state.cache_clear()
        return environment.environment(results)["git"]

    monkeypatch.setattr(environment, "CHECKOUT", checkout)
    git("init")
    (checkout / "code.py").write_text("old\n")
    git("add", ".")
    git("commit", "-m", "first")
    (checkout / "results" / "table.csv").touch()
    clean = state()
    assert (clean["dirty"], clean["diff"], clean["untracked"]) == (False, None, [])
    assert len(clean["commit"]) == 40
    (checkout / "code.py").write_text("edited\n")
    (checkout / "new.py").write_text("added\n")
    (checkout / "large.bin").write_bytes(bytes(300_000))
    dirty = state()
    assert dirty["commit"] == clean["commit"]
    assert dirty["dirty"]
    assert dirty["untracked"] == ["large.bin", "new.py"]
    assert state() == dirty
    (kept,) = (results / "diffs").iterdir()
    assert kept.name == dirty["diff"]
    git("stash")
    (checkout / "new.py").unlink()
    git("apply", str(kept))
    assert (checkout / "code.py").read_text() == "edited\n"
    assert (checkout / "new.py").read_text() == "added\n"
    environment._git_state.cache_clear()
