"""Names that are read from files."""

from pathlib import Path

import pytest

from experiments.tracking.names import UnsafePath, inner_path, is_digest, is_identity, is_name


@pytest.mark.parametrize("name", ["summary.csv", "a", "c1", "größe", "a-b_c.tar.gz"])
def test_plain_names(name: str) -> None:
    assert is_name(name)


@pytest.mark.parametrize("name", ["", ".", "..", ".hidden", "a/b", "/etc", "a b", "a\n", None, 3])
def test_what_is_no_plain_name(name: object, tmp_path: Path) -> None:
    assert not is_name(name)
    if isinstance(name, str):
        with pytest.raises(UnsafePath, match="is no plain name"):
            inner_path(tmp_path, "points", name)


def test_identities_and_digests_are_hex_digits() -> None:
    assert is_identity("0" * 32)
    assert is_digest("f" * 64)
    assert not any(map(is_identity, ("0" * 31, "0" * 33, "g" * 32, "A" * 32, None)))
    assert not any(map(is_digest, ("0" * 32, "0" * 65, 0)))


def test_nothing_on_the_way_is_a_link(tmp_path: Path) -> None:
    (tmp_path / "real" / "points").mkdir(parents=True)
    (tmp_path / "results").symlink_to(tmp_path / "real")  # the folder of results may be one
    assert inner_path(tmp_path / "results", "points", "a") == tmp_path / "results" / "points" / "a"
    (tmp_path / "real" / "s").symlink_to(tmp_path)
    with pytest.raises(UnsafePath, match="is a link"):
        inner_path(tmp_path / "results", "s", "tables")
