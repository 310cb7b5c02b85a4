"""Hashes of the source that a result depends on."""

import sys
from pathlib import Path

import pytest

from experiments.tracking import sources
from experiments.tracking.sources import source_hash


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for packages and modules that can be imported."""
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def hashed(*modules: str) -> str:
    """The hash as a new process has it."""
    for cached in sources.CACHES:
        cached.cache_clear()
    return source_hash(modules)


def test_edit_of_an_imported_module_changes_the_source_hash(package: Path) -> None:
    folder = package / "edited"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "top.py").write_text("def late():\n    from edited import middle\n")
    (folder / "middle.py").write_text("from .leaf import VALUE\n")
    (folder / "leaf.py").write_text("VALUE = 1\n")
    (folder / "stranger.py").write_text("VALUE = 1\n")
    before = hashed("edited.top")
    (folder / "stranger.py").write_text("VALUE = 2\n")
    assert hashed("edited.top") == before
    (folder / "leaf.py").write_text("VALUE = 2\n")
    assert hashed("edited.top") != before
    (folder / "__init__.py").write_text("VALUE = 2\n")
    assert "edited" not in sys.modules  # it is read, never run


def test_module_of_a_user_counts_what_it_imports_from_the_project_and_nothing_else(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sources, "_PROJECT", ("project",))
    for name in ("project", "installed"):
        (package / "site-packages" / name).mkdir(parents=True)
    monkeypatch.syspath_prepend(str(package / "site-packages"))
    (package / "mine.py").write_text("import installed.module\nfrom project import module\n")

    def after(name: str, text: str) -> str:
        (package / "site-packages" / name / "module.py").write_text(text)
        return hashed("mine")

    before = [after(name, "A = 1\n") for name in ("installed", "project")]
    assert after("installed", "A = 2\n") == before[1]
    assert after("project", "A = 2\n") != before[1]


def test_unknown_module_is_no_error(package: Path) -> None:
    assert hashed("nothing.at.all") != hashed("something.else")
    assert hashed("") == hashed("")


def test_what_changes_no_result_does_not_count(package: Path) -> None:
    path = package / "module_of_test.py"
    path.write_text('"""Says."""\n\ndef area(a: float) -> float:\n    return a * a\n')
    before = hashed("module_of_test")
    path.write_text(
        '"""Says more."""\n# A comment.\ndef area(a: float) -> float:\n    """Its docstring."""\n'
        '    print(f"the area of {a}")\n    log("of it")\n    return a*a\n'
    )
    assert hashed("module_of_test") == before
    path.write_text("def area(a: float) -> float:\n    return a * a + 1\n")
    assert hashed("module_of_test") != before
    path.write_text("def area(a: float) -> float:\n    x = print(a)\n    return a * a\n")
    assert hashed("module_of_test") != before


def test_versions_of_packages_that_decide_numbers_count(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (package / "module_of_test.py").write_text("import numpy, pydantic, json\n")
    versions = {"numpy": "1.0", "pydantic": "1.0"}
    monkeypatch.setattr(sources, "version", versions.__getitem__)
    hashes = []
    for package_name in (None, "pydantic", "numpy"):
        if package_name:
            versions[package_name] = "2.0"
        sources._version.cache_clear()
        hashes.append(hashed("module_of_test"))
    sources._version.cache_clear()
    assert hashes[0] == hashes[1] != hashes[2]


def test_a_module_alone_counts_without_its_imports(package: Path) -> None:
    (package / "writer_of_test.py").write_text("import leaf_of_test\nA = 1\n")
    (package / "leaf_of_test.py").write_text("A = 1\n")

    def now() -> str:
        hashed()
        return source_hash([], alone=["writer_of_test"])

    before = now()
    (package / "leaf_of_test.py").write_text("A = 2\n")
    assert now() == before
    (package / "writer_of_test.py").write_text("import leaf_of_test\nA = 2\n")
    assert now() != before
