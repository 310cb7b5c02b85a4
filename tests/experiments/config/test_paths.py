"""Where results go."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from experiments.config.paths import results_folder


def test_a_tilde_is_ones_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert results_folder(SimpleNamespace(results="~/results")) == (tmp_path / "results").resolve()
