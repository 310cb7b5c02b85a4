"""Shared stages: computed once, keyed by content, verified when read."""

import logging
import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from experiments.tracking import store as store_module
from experiments.tracking import trees
from experiments.tracking.store import Store


class Counted:
    """A stage's computation, which counts how often it is done."""

    def __init__(self, wait: float = 0.0) -> None:
        self.wait, self.times = wait, 0

    def __call__(self) -> dict[str, np.ndarray]:
        time.sleep(self.wait)
        self.times += 1
        return {"values": np.arange(6.0).reshape(2, 3) / 7, "names": np.array(["ab", "c"])}


def get(store: Store, compute: Counted, **depends: object) -> store_module.Stored:
    return store.get("stage", depends or {"dt": 0.1}, [trees], compute)


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
    region = {"lower": (None, 0.0), "upper": (None, 1.0)}
    keys = {
        get(store, compute, dt=0.1).key,
        get(store, compute, dt=0.2).key,
        get(store, compute, dt=0.1, truth=region).key,
        get(store, compute, dt=0.1, truth={**region, "upper": (None, 1.5)}).key,
        store.get("other", {"dt": 0.1}, [trees], compute).key,
        store.get("stage", {"dt": 0.1}, [store_module], compute).key,
    }
    assert len(keys) == compute.times == 6
    assert get(store, compute, dt=0.1).key in keys
    assert compute.times == 6


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


def test_arrays_count_once_their_note_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compute, order = Counted(), []
    replace = os.replace
    monkeypatch.setattr(
        os, "replace", lambda part, path: (order.append(path.suffix), replace(part, path))
    )
    key = get(Store(tmp_path), compute).key
    assert order == [".npz", ".json"]
    (tmp_path / "stage" / f"{key}.json").unlink()  # as after a kill between the two
    get(Store(tmp_path), compute)
    assert compute.times == 2


def test_old_note_is_gone_before_new_arrays_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compute = Counted()
    key = get(Store(tmp_path), compute).key
    arrays, note = tmp_path / "stage" / f"{key}.npz", tmp_path / "stage" / f"{key}.json"
    arrays.write_bytes(b"damaged")
    replace = os.replace

    def check(part: str, path: Path) -> None:
        assert path == note or not note.exists()
        replace(part, path)

    monkeypatch.setattr(os, "replace", check)
    get(Store(tmp_path), compute)
    assert note.exists()


def test_time_of_a_stage_is_counted_even_if_it_fails(tmp_path: Path) -> None:
    store = Store(tmp_path)

    def fail() -> dict[str, np.ndarray]:
        time.sleep(0.05)
        raise ArithmeticError

    for _ in range(2):
        with pytest.raises(ArithmeticError):
            store.get("stage", {}, [], fail)
    assert 0.1 <= store.seconds["stage"] < 5
    assert set(store.keys) == {"stage"}


def test_a_copied_entry_is_as_whole_as_its_original(tmp_path: Path) -> None:
    store, other = Store(tmp_path / "store"), Store(tmp_path / "other")
    one = get(store, Counted(), dt=0.1)
    get(store, Counted(), dt=0.2)
    assert store.copy("stage", one.key, other)
    ((made_from, arrays),) = other.entries("stage")
    assert made_from["depends"] == {"dt": 0.1}
    assert arrays.key == one.key
    np.testing.assert_array_equal(arrays["values"], one["values"])
    assert len(list(store.entries("stage"))) == 2
    assert list(store.entries("another")) == []


def test_a_damaged_entry_is_neither_copied_nor_listed(tmp_path: Path) -> None:
    store, other = Store(tmp_path / "store"), Store(tmp_path / "other")
    key = get(store, Counted()).key
    (store.folder / "stage" / f"{key}.npz").write_bytes(b"")
    assert not store.copy("stage", key, other)
    assert list(store.entries("stage")) == []
    assert not other.folder.exists()
