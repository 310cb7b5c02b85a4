"""Compiled loops do what the Python function does, wherever machine code can be kept."""

from __future__ import annotations

import errno
import importlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import mlci
from mlci.compiled import Compiled
from mlci.precompile import MODULES, precompile

LOOPS = '''
from mlci.compiled import compiled
import numpy as np

@compiled("f8(f8)")
def square(x):
    """x^2."""
    return x * x

@compiled("void(f8[::1], f8[::1])")
def running_norm(values, norms):
    total = 0.0
    for k in range(len(values)):
        total += square(values[k])
        norms[k] = np.sqrt(total)
'''


@pytest.fixture
def loops(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[ModuleType]:
    """A module of two compiled functions, one of which calls the other."""
    (tmp_path / "loops.py").write_text(LOOPS)
    monkeypatch.syspath_prepend(tmp_path)
    yield importlib.import_module("loops")
    del sys.modules["loops"]


def test_compiled_equals_python(loops: ModuleType) -> None:
    values = np.random.default_rng(0).normal(size=20)
    norms, expected = np.zeros(20), np.zeros(20)
    loops.running_norm(values, norms)
    loops.running_norm.function(values, expected)
    np.testing.assert_allclose(norms, expected, rtol=1e-15)
    np.testing.assert_allclose(norms, np.sqrt(np.cumsum(values**2)), rtol=1e-14)
    assert loops.square.__doc__ == "x^2."


def test_other_types_than_those_of_the_signature_are_refused(loops: ModuleType) -> None:
    with pytest.raises(TypeError, match="No matching definition"):
        loops.running_norm(np.zeros((2, 2)), np.zeros(2))


def test_machine_code_is_kept_on_disk_and_read_again(
    loops: ModuleType, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "mlci.compiled")
    loops.square(2.0)
    assert caplog.messages == ["compiling, once on this machine", "compiled"]
    caplog.clear()
    kept = {path.name: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nbc")}
    assert len(kept) == 1
    assert Compiled(loops.square.function, loops.square.signature)(3.0) == 9
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nbc")} == kept
    assert not caplog.messages


def test_where_nothing_can_be_kept_it_still_runs(
    monkeypatch: pytest.MonkeyPatch, loops: ModuleType, tmp_path: Path
) -> None:
    from numba.core import caching

    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    assert loops.square(3.0) == 9
    assert not list(tmp_path.rglob("*.nbc"))


def test_a_disk_that_is_full_stops_nothing(
    monkeypatch: pytest.MonkeyPatch, loops: ModuleType, tmp_path: Path
) -> None:
    from numba.core import caching

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", full)
    assert loops.square(3.0) == 9
    assert not list(tmp_path.rglob("*.nbc"))


def test_all_that_is_compiled_can_be_compiled_ahead(loops: ModuleType, tmp_path: Path) -> None:
    root = Path(mlci.__file__).parents[1]
    written = {
        ".".join(path.relative_to(root).with_suffix("").parts)
        for path in root.glob("mlci/**/*.py")
        if "\n@compiled(" in path.read_text(encoding="utf-8")
    }
    assert written == {*MODULES}
    assert precompile("loops") == 2
    assert len(list(tmp_path.rglob("*.nbc"))) == 2


def test_numba_is_imported_by_the_first_call() -> None:
    code = "import sys, mlci, mlci.maxent; assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
