"""Files that carry their own digest."""

from pathlib import Path

import pytest

from experiments.tracking.sealed import SealError, read_sealed, write_sealed

TREE = {"identity": "ab", "config": {"dt": 0.1, "shape": [4, 3]}, "none": None, "text": "größe"}


def test_every_change_of_a_character_is_noticed(tmp_path: Path) -> None:
    path = tmp_path / "record.json"
    write_sealed(path, TREE)
    assert read_sealed(path) == TREE
    data = path.read_bytes()
    for place in range(len(data)):
        path.write_bytes(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :])
        with pytest.raises(SealError, match="not as it was written"):
            read_sealed(path)
    for end in range(len(data)):
        path.write_bytes(data[:end])
        with pytest.raises(SealError):
            read_sealed(path)


@pytest.mark.parametrize("text", ["null", "[]", "3", "{}", '{"digest": "0"}', "[" * 100_000])
def test_other_json_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(SealError):
        read_sealed(tmp_path / "a.json")
