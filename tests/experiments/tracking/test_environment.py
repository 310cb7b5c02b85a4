"""What a record says about code and machine, and the memory that a point needed."""

import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

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


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A repository with a commit, as if it were the project's checkout."""
    folder = tmp_path / "checkout"
    (folder / "results").mkdir(parents=True)
    monkeypatch.setattr(environment, "CHECKOUT", folder)
    git(folder, "init")
    (folder / "code.py").write_text("old\n")
    git(folder, "add", ".")
    git(folder, "commit", "-m", "first")
    yield folder
    environment._git_state.cache_clear()


def git(folder: Path, *arguments: str) -> None:
    author = ["-c", "user.name=n", "-c", "user.email=e"]
    subprocess.run(["git", *author, *arguments], cwd=folder, check=True, capture_output=True)


def state(results: Path) -> dict[str, Any]:
    environment._git_state.cache_clear()
    return environment.environment(results)["git"]


def check_applies(checkout: Path, kept: Path) -> None:
    """The diff, applied to the commit, gives the code back."""
    git(checkout, "stash")
    (checkout / "new.py").unlink()
    git(checkout, "apply", str(kept))
    assert (checkout / "code.py").read_text() == "edited\n"
    assert (checkout / "new.py").read_text() == "added\n"


def edit(checkout: Path) -> None:
    (checkout / "code.py").write_text("edited\n")
    (checkout / "new.py").write_text("added\n")


def test_changes_since_the_commit_are_kept_once(checkout: Path, tmp_path: Path) -> None:
    results = tmp_path / "results"
    (checkout / "results" / "table.csv").touch()
    clean = state(results)
    assert (clean["dirty"], clean["diff"], clean["untracked"]) == (False, None, [])
    assert (len(clean["commit"]), clean["reason"]) == (40, None)
    edit(checkout)
    (checkout / "large.py").write_bytes(bytes(300_000))
    dirty = state(results)
    assert dirty["commit"] == clean["commit"]
    assert dirty["dirty"]
    assert dirty["untracked"] == ["large.py", "new.py"]
    assert state(results) == dirty
    (kept,) = (results / "diffs").iterdir()
    assert kept.name == dirty["diff"]
    check_applies(checkout, kept)


def test_a_diff_applies_whatever_the_users_settings(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "other"
    other.mkdir()
    git(other, "init")
    for key, value in {
        "DIR": other / ".git",
        "WORK_TREE": other,
        "INDEX_FILE": other / "x",
    }.items():
        monkeypatch.setenv(f"GIT_{key}", str(value))
    settings = "[color]\nui = always\n[diff]\nnoprefix = true\nexternal = echo\nrelative = true\n"
    (tmp_path / ".gitconfig").write_text(settings)
    monkeypatch.setenv("HOME", str(tmp_path))
    edit(checkout)
    kept = state(tmp_path / "results")["diff"]
    for key in ("DIR", "WORK_TREE", "INDEX_FILE"):
        monkeypatch.delenv(f"GIT_{key}")
    check_applies(checkout, tmp_path / "results" / "diffs" / kept)


def test_secrets_are_no_part_of_a_diff(checkout: Path, tmp_path: Path) -> None:
    (checkout / ".gitignore").write_text("ignored.py\n")
    for name in (".env", "id_rsa", "token.txt", "ignored.py", ".hidden.py", "private.py", "new.py"):
        (checkout / name).write_text(f"secret of {name}\n")
    for name in ("id_rsa", "private.py"):
        (checkout / name).chmod(0o600)
    (checkout / "link.py").symlink_to(checkout / "id_rsa")
    found = state(tmp_path)
    text = (tmp_path / "diffs" / found["diff"]).read_text()
    assert [line for line in text.splitlines() if "secret" in line] == ["+secret of new.py"]
    assert {".env", "id_rsa", "private.py"} < set(found["untracked"])


def test_a_diff_is_no_more_readable_than_what_is_in_it(checkout: Path, tmp_path: Path) -> None:
    edit(checkout)
    (checkout / "code.py").chmod(0o600)
    kept = tmp_path / "diffs" / state(tmp_path)["diff"]
    assert kept.stat().st_mode & 0o777 == 0o600


def test_an_unknown_commit_has_a_reason(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(environment, "CHECKOUT", tmp_path)  # no repository
    found = state(tmp_path)
    assert (found["commit"], found["dirty"]) == (None, None)
    assert found["reason"].startswith("git says: fatal: not a git repository")
    monkeypatch.setattr(environment, "CHECKOUT", None)
    assert state(tmp_path)["reason"] == "the code is an installed package, not a checkout"
    monkeypatch.setattr(environment, "CHECKOUT", checkout)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert state(tmp_path)["reason"] == "git is not installed"
