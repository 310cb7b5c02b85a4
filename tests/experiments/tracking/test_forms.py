"""What a file may say that carries its own digest, and what readers make of it."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest
from hand_made import alter, hand_made

from experiments.collate.join import collate
from experiments.tracking.figure_notes import sentence
from experiments.tracking.forms import is_deep, record_fault, sound_study, study_fault
from experiments.tracking.sealed import read_sealed
from experiments.tracking.study import read_study, write_plan


def nested(depth: int) -> Any:
    return json.loads("[" * depth + "]" * depth)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({}, None),
        ({"attempt": 2}, None),
        ({"attempt": None}, "its attempt is no number"),
        ({"seconds": None}, "its seconds is missing, or of another kind"),
        ({"seconds": {}}, "its seconds.total is missing, or of another kind"),
        ({"git": {"commit": 3}}, "its git.commit is missing, or of another kind"),
        ({"started": 3}, "its started is missing, or of another kind"),
        ({"host": nested(100)}, "it nests too deep"),
    ],
)
def test_a_record_is_of_a_form(change: dict[str, Any], fault: str | None, tmp_path: Path) -> None:
    record = read_sealed(hand_made(tmp_path).folder / "record.json")
    assert record_fault(record | change) == fault


def test_depth_is_measured_without_recursion() -> None:
    assert not is_deep({"a": [1, {"b": "c"}]})
    assert is_deep(nested(900))


@pytest.mark.parametrize("key", ["sources", "systems", "commits", "versions", "kept", "made_by"])
@pytest.mark.parametrize("value", [None, 3, {"a": "b"}, [None]])
def test_a_study_is_of_a_form(key: str, value: object, tmp_path: Path) -> None:
    points = [hand_made(tmp_path)]
    write_plan(tmp_path / "s", [(point, ["seed=0"]) for point in points])
    collate(points, tmp_path / "s")
    assert sound_study(tmp_path / "s") == read_study(tmp_path / "s")
    assert "1 point (digest" in sentence(tmp_path / "s")
    path = tmp_path / "s" / "study.json"
    alter(path, collated={**read_sealed(path)["collated"], key: value})
    study = read_study(tmp_path / "s")
    assert study is not None
    assert study_fault(study) == f"its {key}: of another kind than a sweep writes"
    assert sound_study(tmp_path / "s") is None
    assert sentence(tmp_path / "s") == "study s, whose points are not listed"


def test_overrides_of_a_study_are_texts(tmp_path: Path) -> None:
    write_plan(tmp_path / "s", [(hand_made(tmp_path), ["seed=0"])])
    study = read_study(tmp_path / "s")
    assert study is not None
    odd = dataclasses.replace(study, points=dict.fromkeys(study.points, (3, None)))
    assert study_fault(study) is None
    assert study_fault(odd) == "its points: of another kind than a sweep writes"
