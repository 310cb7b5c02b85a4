"""What runs for one config: what reaches the attempt, and what a single run says."""

from pathlib import Path
from typing import Any

import pytest
from omegaconf import OmegaConf
from tiny_point import TINY, composed

from experiments.config.read import ConfigError
from experiments.sweep import attempt
from experiments.sweep.plan import read_point
from experiments.sweep.worker import run_single, run_task
from experiments.tracking.points import State


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The attempts that would be made."""
    calls: list[Any] = []
    monkeypatch.setattr(
        attempt,
        "run_in_worker",
        lambda point, settings, **options: calls.append((point, options)) or State.RUNNING,
    )
    monkeypatch.setattr(
        attempt, "run_here", lambda point, settings, log, **options: calls.append((point, options))
    )
    return calls


def tree(results: Path, *words: str) -> dict[str, Any]:
    return composed(*TINY, f"results={results}", *words)


@pytest.mark.parametrize(
    ("words", "options"),
    [
        ([], {"force": False, "time_limit": None}),
        (["sweep.force=true", "sweep.time_limit=7"], {"force": True, "time_limit": 7.0}),
    ],
)
def test_options_reach_the_attempt(
    words: list[str], options: dict[str, Any], tmp_path: Path, calls: list[Any]
) -> None:
    config = tree(tmp_path, *words)
    assert run_task(OmegaConf.create(config)) is State.RUNNING
    run_single({**config, "sweep": {**config["sweep"], "time_limit": None}})
    point = read_point(config)[0]
    assert calls == [(point, options), (point, {"force": options["force"]})]


@pytest.mark.parametrize(
    "word",
    [
        *("sweep.only=[failed]", "sweep.limit=1", "sweep.time_limit=1", "sweep.retries=1"),
        *("sweep.fail_fast=true", "sweep.mix_sources=true"),
    ],
)
def test_single_run_refuses_what_only_a_sweep_heeds(
    word: str, tmp_path: Path, calls: list[Any]
) -> None:
    key = word.partition("=")[0]
    with pytest.raises(ConfigError, match=f"^{key}: only a sweep heeds it; add -m, or leave"):
        run_single(tree(tmp_path, word))
    assert not calls


def test_dry_single_run_writes_nothing(
    tmp_path: Path, calls: list[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    config = tree(tmp_path, "sweep.dry_run=true")
    run_single(config)
    assert capsys.readouterr().out == f"missing: {read_point(config)[0].folder}\n"
    assert not calls
    assert not list(tmp_path.iterdir())


def test_single_run_waits_aloud_for_another_process(
    tmp_path: Path, calls: list[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    config = tree(tmp_path)
    point = read_point(config)[0]
    point.folder.mkdir(parents=True)
    with point.lock:
        run_single(config)
    assert capsys.readouterr().out.splitlines() == [
        f"another process runs this point, and is waited for: {point.folder}",
        f"written: {point.folder}",
    ]
