"""Files that are the old one or the new one, whatever happens."""

import os
import re
import time
from pathlib import Path

import pandas as pd
import pytest

from experiments.tracking import files
from experiments.tracking.files import (
    PART,
    csv_bytes,
    exchange_folders,
    growing,
    read_file,
    replace_file,
    replacing,
)


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    replace_file(path, b"old")

    def full(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OSError, match="no space left"):
        replace_file(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_new_file_takes_the_place_of_the_old_one_at_the_end_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "deep" / "file"
    replace_file(path, b"old")
    order = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda file: (order.append("fsync"), fsync(file)))
    monkeypatch.setattr(os, "replace", lambda *names: (order.append("replace"), replace(*names)))
    with replacing(path) as file:
        file.write(b"new")
        file.flush()
        assert path.read_bytes() == b"old"
        assert Path(file.name).name.startswith(".file-")
        assert Path(file.name).name.endswith(PART)
    assert order == ["fsync", "replace", "fsync"]  # the file, then its name
    assert path.read_bytes() == b"new"
    assert path.stat().st_mode & 0o777 == 0o644
    assert list(path.parent.iterdir()) == [path]


def test_error_in_the_block_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "file"
    replace_file(path, b"old")

    def stop_halfway() -> None:
        with replacing(path) as file:
            file.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stop_halfway()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_csv_has_exact_floats() -> None:
    data = csv_bytes(pd.DataFrame({"a": [1 / 3, 5e-324], "b": ["x,y", None]}))
    assert data == b'a,b\n0.3333333333333333,"x,y"\n5e-324,\n'


def test_only_regular_files_are_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"content")
    assert read_file(tmp_path / "file") == b"content"
    (tmp_path / "link").symlink_to(tmp_path / "file")
    os.mkfifo(tmp_path / "pipe")
    for name, reason in (("link", "is a link"), ("pipe", "no regular file"), (".", "regular")):
        with pytest.raises(OSError, match=reason):
            read_file(tmp_path / name)


def test_a_digest_is_that_of_the_file_of_now(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of one that another file of its size and time has taken the place of, or a link."""
    path, new, later = tmp_path / "table.csv", tmp_path / "new", time.time_ns() + 3600 * 10**9
    monkeypatch.setattr(time, "time_ns", lambda: later)
    for content in (b"a\n1\n", b"a\n2\n"):
        new.write_bytes(content)
        os.utime(new, (1e9, 1e9))
        os.replace(new, path)
        assert [files.file_digest(path) for _ in range(2)] == [files.digest(content)] * 2
    path.rename(new)
    path.symlink_to(new)
    with pytest.raises(OSError, match="link"):
        files.file_digest(path)


def test_a_file_that_did_not_change_is_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And one that may change within a step of its file system's clock each time."""
    path, reads = tmp_path / "table.csv", []
    path.write_bytes(b"a\n1\n")
    changed = max(path.stat().st_mtime_ns, path.stat().st_ctime_ns)
    monkeypatch.setattr(files, "read_file", lambda each: reads.append(each) or b"")
    for age, count in ((files._STEP, 2), (files._STEP + 1, 1)):
        monkeypatch.setattr(time, "time_ns", lambda age=age: changed + age)
        reads.clear()
        for _ in range(2):
            files.file_digest(path)
        assert len(reads) == count


def test_a_file_is_settled_two_seconds_after_the_later_of_its_times(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The time of the content may be set back, and then that of the inode is young."""
    now = 10**18
    monkeypatch.setattr(time, "time_ns", lambda: now)
    old, young = now - 2 * 10**9 - 1, now - 2 * 10**9
    assert files.is_settled([4, old, old, 1])
    assert not files.is_settled([4, old, young, 1])
    assert not files.is_settled([4, young, old, 1])


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_the_umask_says_who_may_read(mask: int, tmp_path: Path) -> None:
    before = os.umask(mask)
    try:
        replace_file(tmp_path / "file", b"")
        with growing(tmp_path / "log"):
            pass
    finally:
        os.umask(before)
    for name in ("file", "log"):
        assert (tmp_path / name).stat().st_mode & 0o777 == 0o666 & ~mask


def test_a_log_takes_the_place_of_a_link_and_leaves_its_target(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("of somebody else")
    (tmp_path / "log.txt").symlink_to(tmp_path / "target")
    with growing(tmp_path / "log.txt") as file:
        file.write("größe\n")
        assert (tmp_path / "log.txt").read_text(encoding="utf-8") == "größe\n"
    assert (tmp_path / "target").read_text() == "of somebody else"


@pytest.mark.parametrize("can_exchange", [True, False])
def test_folders_change_names(
    can_exchange: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not can_exchange:
        monkeypatch.setattr(files, "_exchanged", lambda *_: False)
    new, old = tmp_path / "new", tmp_path / "old"
    replace_file(new / "a", b"1")
    exchange_folders(new, old)
    assert not new.exists()
    replace_file(new / "a", b"2")
    exchange_folders(new, old)
    assert ((old / "a").read_bytes(), (new / "a").read_bytes()) == (b"2", b"1")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new", "old"]


# What else writes: into a file of the kernel. The library writes where its caller says.
_OTHERS = {"experiments/tracking/environment.py"}
_WRITES = re.compile(
    r"""\.write_(text|bytes)\(|open\([^)]*["'][wxa]b?\+?["']|savefig\((?!content)|\.to_csv\([^i)]"""
    r"""|\.to_(csv|parquet|json)\((path|folder)|np\.savez?\((?!buffer)|\.touch\(|mkstemp|shutil\.copy"""
)


def test_there_is_one_way_to_write_a_file() -> None:
    root = Path(files.__file__).parents[2]
    packages = [root / name for name in ("experiments", "paper_figures")]
    paths = [path for package in packages for path in package.rglob("*.py")]
    found = {
        path.relative_to(root).as_posix(): line.strip()
        for path in paths
        for line in path.read_text(encoding="utf-8").splitlines()
        if _WRITES.search(line) and "os.devnull" not in line
    }
    assert found.pop("experiments/tracking/files.py", None)
    assert set(found) <= _OTHERS, found
