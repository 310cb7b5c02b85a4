"""What `make install` takes of the lock file: all that running needs, with hashes, and no tools."""

from __future__ import annotations

import re
import runpy
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LOCK = (ROOT / "requirements.lock").read_text()
needed = runpy.run_path(str(ROOT / ".ci" / "needed.py"))["needed"]


def names(entries: str) -> set[str]:
    return set(re.findall(r"^([\w.-]+)==", entries, re.MULTILINE))


def test_running_needs_dependencies_and_theirs_and_no_tools() -> None:
    entries = needed(LOCK, PROJECT, [])
    assert {"numpy", "hydra-core", "omegaconf", "pyyaml"} <= names(entries)
    assert not {"pytest", "mypy", "pyarrow", "dask", "submitit", "uv"} & names(entries)
    assert names(needed(LOCK, PROJECT, ["parquet"])) - names(entries) == {"pyarrow"}
    for line in entries.splitlines():
        assert re.match(r"[\w.-]+==|    --hash=sha256:|    #", line), line
    assert all(f"{name}==" in LOCK for name in names(entries))
    assert entries.count("--hash=") > len(names(entries))


def test_what_only_the_benchmark_compares_with_is_not_locked() -> None:
    locked = re.search(r"^LOCKED := (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert locked is not None
    assert {*locked[1].split(), "bench"} == set(PROJECT["optional-dependencies"])
    peers = PROJECT["optional-dependencies"]["bench"]
    assert not {re.split(r"[^\w-]", line)[0] for line in peers} & names(LOCK)


def test_a_dependency_that_the_lock_lacks_is_named() -> None:
    with pytest.raises(SystemExit, match=r"requirements\.lock lacks unheard-of: run make lock"):
        needed(LOCK, {**PROJECT, "dependencies": ["unheard_of>=1"]}, [])
