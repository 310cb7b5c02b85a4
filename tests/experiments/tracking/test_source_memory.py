"""What is remembered of source files: never what they were before a change."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from experiments.tracking import source_memory, sources
from experiments.tracking.files import _STEP
from experiments.tracking.source_memory import SourceMemory

HOUR = 3_600_000_000_000  # [ns]


@pytest.fixture(autouse=True)
def later(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files of a test are old when they are read, and bytecode is written."""
    now = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: now() + HOUR)
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    monkeypatch.setattr("sys.pycache_prefix", None)


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A module that reads, and a file that it reads."""
    for name in ("reader.py", "read.py"):
        (tmp_path / name).write_text("A = 1\n")
    return tmp_path / "reader.py", tmp_path / "read.py"


class Process:
    """A process that reads files, and counts how often."""

    def __init__(self, reader: Path) -> None:
        self.memory = SourceMemory(str(reader))
        self.reads = 0

    def read(self, path: Path) -> str:
        """The content of a file, as the process knows it before it ends."""

        def read(name: str) -> str:
            self.reads += 1
            return Path(name).read_text()

        content: str = self.memory.recall(str(path), read)
        self.memory.save()
        return content


def test_another_process_reads_nothing_again(files: tuple[Path, Path]) -> None:
    reader, path = files
    assert [Process(reader).read(path) for _ in range(2)] == ["A = 1\n"] * 2
    second = Process(reader)
    second.read(path)
    assert second.reads == 0
    assert second.memory.path.parent.name == "__pycache__"


def replaced(path: Path) -> None:
    """Another file of the same size and times, as far as anybody can set them."""
    before = path.stat()
    new = path.with_suffix(".new")
    new.write_text("A = 2\n")
    os.replace(new, path)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


def edited(path: Path) -> None:
    """The same file, of the same size and time of last change."""
    before = path.stat()
    time.sleep(0.05)  # a step of the clock, which the time of change of the inode shows
    path.write_text("A = 2\n")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.mark.parametrize("change", [replaced, edited])
def test_no_change_goes_unnoticed(files: tuple[Path, Path], change: Callable[[Path], None]) -> None:
    reader, path = files
    Process(reader).read(path)
    change(path)
    assert Process(reader).read(path) == "A = 2\n"


def test_a_file_as_young_as_the_step_of_a_clock_is_not_remembered(
    files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a file system whose clock stands still between two edits."""
    reader, path = files
    stamps = {str(reader): [6, 0, 0, 1], str(path): [6, HOUR, HOUR, 2]}
    monkeypatch.setattr(source_memory, "file_stamp", lambda name: stamps[name])
    for age, content in ((_STEP, "A = 2\n"), (_STEP + 1, "A = 1\n")):
        path.write_text("A = 1\n")
        monkeypatch.setattr(time, "time_ns", lambda age=age: HOUR + age)
        Process(reader).read(path)
        path.write_text("A = 2\n")
        assert Process(reader).read(path) == content


def test_what_another_version_of_the_reader_read_is_forgotten(files: tuple[Path, Path]) -> None:
    reader, path = files
    old = Process(reader)
    replaced(reader)
    old.read(path)  # after its file has changed
    new = Process(reader)
    new.read(path)
    assert new.reads == 1


def test_a_reader_that_changes_as_it_is_imported_remembers_nothing(
    files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, path = files
    changed = reader.stat().st_ctime_ns
    with monkeypatch.context() as patch:
        patch.setattr(time, "time_ns", lambda: changed)
        young = Process(reader)
    young.read(path)
    assert not young.memory.path.exists()


@pytest.mark.parametrize("content", ["", "[]", "no digest\n[[], {}]", "\0\n\0"])
def test_a_damaged_memory_is_none(files: tuple[Path, Path], content: str) -> None:
    reader, path = files
    first = Process(reader)
    first.read(path)
    first.memory.path.write_text(content)
    assert Process(reader).read(path) == "A = 1\n"
    third = Process(reader)
    third.read(path)
    assert third.reads == 0  # it is written anew


def test_no_character_of_a_memory_can_be_changed(files: tuple[Path, Path]) -> None:
    reader, path = files
    first = Process(reader)
    first.read(path)
    told = first.memory.path.read_text()
    first.memory.path.write_text(told.replace("A = 1", "A = 2"))
    assert told != first.memory.path.read_text()
    assert Process(reader).read(path) == "A = 1\n"


def test_files_are_read_where_nothing_can_be_written_or_is_to_be(
    files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, path = files
    (reader.parent / "__pycache__").write_text("no folder")
    assert Process(reader).read(path) == "A = 1\n"
    (reader.parent / "__pycache__").unlink()
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    assert Process(reader).read(path) == "A = 1\n"
    assert not (reader.parent / "__pycache__").exists()


def test_the_source_hash_is_the_same_from_memory_and_parses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a point, which depends on half of the project."""
    parsed: list[str] = []

    def now() -> str:
        monkeypatch.setattr(sources, "_MEMORY", memory())
        sources._hash.cache_clear()
        sources._read_source.cache_clear()
        return sources.source_hash(["experiments.point.run"])

    def memory() -> SourceMemory:
        memory = SourceMemory(sources.__file__)
        memory.path = tmp_path / "memory.json"
        return memory

    read = sources._parsed
    monkeypatch.setattr(sources, "_parsed", lambda path: parsed.append(path) or read(path))
    first = now()
    assert len(parsed) > 50
    parsed.clear()
    assert now() == first
    assert parsed == []
