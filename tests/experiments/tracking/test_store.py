"""Shared stages: computed once, keyed by content, verified when read."""

import logging
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import mlci.grids
from experiments.config.settings import Region
from experiments.tracking import files, sources
from experiments.tracking import store as store_module
from experiments.tracking.files import digest, replace_file
from experiments.tracking.sources import source_hash
from experiments.tracking.store import Store
from experiments.tracking.trees import canonical_json


class Counted:
    """A stage's computation, which counts how often it is done."""

    def __init__(self, wait: float = 0.0) -> None:
        self.wait, self.times = wait, 0

    def __call__(self) -> dict[str, np.ndarray]:
        time.sleep(self.wait)
        self.times += 1
        return {"values": np.arange(6.0).reshape(2, 3) / 7, "names": np.array(["ab", "c"])}


def get(store: Store, compute: Counted, **depends: object) -> store_module.Stored:
    return store.get("stage", depends or {"dt": 0.1}, [mlci.grids], compute)


def test_second_use_reads_what_the_first_computed(tmp_path: Path) -> None:
    compute = Counted()
    first = get(Store(tmp_path), compute)
    second = get(Store(tmp_path), compute)
    assert compute.times == 1
    assert first.key == second.key
    assert second["values"].dtype == np.float64
    np.testing.assert_array_equal(second["values"], compute()["values"])
    np.testing.assert_array_equal(second["names"], ["ab", "c"])


def test_key_is_made_from_all_that_the_stage_depends_on(tmp_path: Path) -> None:
    store, compute = Store(tmp_path), Counted()
    region = Region((None, 0.0), (None, 1.0))
    keys = {
        get(store, compute, dt=0.1).key,
        get(store, compute, dt=0.2).key,
        get(store, compute, dt=0.1, truth=region).key,
        get(store, compute, dt=0.1, truth=Region((None, 0.0), (None, 1.5))).key,
        store.get("other", {"dt": 0.1}, [mlci.grids], compute).key,
        store.get("stage", {"dt": 0.1}, [store_module], compute).key,
    }
    assert len(keys) == compute.times == 6
    assert get(store, compute, dt=0.1).key in keys
    assert compute.times == 6


def test_edit_of_an_imported_module_changes_the_source_hash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "edited"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "top.py").write_text("from edited import middle\n")
    (package / "middle.py").write_text("from .leaf import VALUE\n")
    (package / "leaf.py").write_text("VALUE = 1\n")
    (package / "stranger.py").write_text("VALUE = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))

    def hashed() -> str:
        sources._read_source.cache_clear()
        return source_hash(["edited.top"])

    before = hashed()
    (package / "stranger.py").write_text("VALUE = 2\n")
    assert hashed() == before
    (package / "leaf.py").write_text("VALUE = 2\n")
    assert hashed() != before
    (package / "__init__.py").write_text("VALUE = 2\n")
    assert "edited" not in sys.modules  # it is read, never run


@pytest.mark.parametrize("harm", ["truncate", "alter", "remove", "note"])
def test_damaged_entry_is_computed_again(
    harm: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    compute = Counted()
    key = get(Store(tmp_path), compute).key
    arrays, note = tmp_path / "stage" / f"{key}.npz", tmp_path / "stage" / f"{key}.json"
    data = bytearray(arrays.read_bytes())
    if harm == "truncate":
        arrays.write_bytes(data[: len(data) // 2])
    elif harm == "alter":
        data[len(data) // 2] ^= 1
        arrays.write_bytes(data)
    elif harm == "remove":
        arrays.unlink()
    else:
        note.write_text("{")
    with caplog.at_level(logging.WARNING):
        again = get(Store(tmp_path), compute)
    assert compute.times == 2
    assert "damaged and is computed again" in caplog.text
    np.testing.assert_array_equal(again["values"], compute()["values"])
    get(Store(tmp_path), compute)
    assert compute.times == 3  # the line above that compared called it too, the store did not


def test_simultaneous_users_compute_once(tmp_path: Path) -> None:
    compute, found = Counted(wait=0.2), []
    threads = [
        threading.Thread(target=lambda: found.append(get(Store(tmp_path), compute)))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert compute.times == 1
    assert len({stored.key for stored in found}) == 1


def test_python_objects_are_never_stored(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="array 'bad' holds Python objects"):
        Store(tmp_path).get("stage", {}, [], lambda: {"bad": np.array([{}, None])})
    assert not list(tmp_path.rglob("*.npz"))


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    replace_file(path, b"old")

    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(OSError, match="no space left"):
        replace_file(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_canonical_json_is_one_spelling() -> None:
    assert canonical_json({"b": (1.0, None), "a": Region((0.1,), (None,))}) == (
        b'{"a":{"lower":[0.1],"upper":[null]},"b":[1.0,null]}'
    )
    # A changed hash would make every finished point a stranger.
    assert digest(canonical_json({"dt": 0.25, "shape": [20, 20]})).startswith("c208a128")
    with pytest.raises(ValueError, match="not JSON compliant"):
        canonical_json({"dt": float("nan")})
    with pytest.raises(TypeError, match="ndarray"):
        canonical_json({"dt": np.zeros(2)})
