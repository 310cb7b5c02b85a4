"""Regions of any shape in a config: the example of conf/README.md, and what a point makes of it."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from tiny_point import TINY, composed, computed

from experiments.config.paths import CONF
from experiments.config.read import read_config, settings_of_record
from experiments.point.stages import region_inputs, shape_modules
from experiments.tracking.trees import canonical_json, plain

SECTION = (CONF / "README.md").read_text().split("\n## Regions of any shape\n")[1]
TRUTH, MODULE = re.findall(r"^```\w+\n(.*?)^```", SECTION, flags=re.MULTILINE | re.DOTALL)[:2]


@pytest.fixture
def oval(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """The words of the README's truth, in a folder with its module."""
    (tmp_path / "reach.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    tree = yaml.safe_load(TRUTH)
    yield ["truth.boxes=[]", *(f"truth.{key}={_word(value)}" for key, value in tree.items())]
    sys.modules.pop("reach", None)


def _word(value: object) -> str:
    """A value as the command line takes it."""
    return str(value).replace("'", "").replace(": ", ":").replace(", ", ",")


def test_example_is_a_union_of_three_regions(oval: list[str]) -> None:
    settings, _ = read_config(composed(*oval))
    truth = settings.constraint
    assert len(truth) == 3
    states = [[3.4, 0.6], [3.4, 1.6], [1.0, 5.5], [1.0, 0.0], [1.5, 0.0], [1.7, -3.0]]
    inside = truth.signed_distance(states) < 0
    np.testing.assert_array_equal(inside, [True, False, True, False, True, True])
    np.testing.assert_array_equal(inside, truth.violated_by(np.array(states)[:, None]).any(axis=1))


def test_regions_count_for_identity_and_store(oval: list[str]) -> None:
    settings, _ = read_config(composed(*oval))
    same = settings_of_record(plain(settings))
    other, _ = read_config(composed(*oval[:-1], oval[-1].replace("0.9", "0.8")))
    keys = [canonical_json(plain(region_inputs(s, s.constraint))) for s in (settings, same, other)]
    assert keys[0] == keys[1] != keys[2]
    assert "reach" in [module.__name__ for module in shape_modules(settings, settings.constraint)]
    assert shape_modules(settings, settings.candidates) == []


def test_hypotheses_are_numbered_by_kind() -> None:
    settings, _ = read_config(
        composed(
            "hypotheses.shape=[2,null]",
            "hypotheses.balls=[{center:[3.4,0.6],radii:[0.1,null]}]",
            "hypotheses.half_spaces=[{normal:[0,-1],offset:3}]",
            "hypotheses.boxes=[{lower:[3.2,0.1],upper:[3.5,1.0]}]",
        )
    )
    regions = settings.candidates
    kinds = ["box" if each is None else type(each).__name__ for each in regions.shapes]
    assert kinds == ["box", "box", "box", "Ball", "HalfSpace"]
    assert regions.names == tuple("01234")


def test_point_finds_a_ball(tmp_path: Path) -> None:
    words = ["truth.boxes=[]", "truth.balls=[{center:[0.0,0.0],radii:[0.9,null]}]"]
    words += ["hypotheses.balls=[{center:[0.0,0.0],radii:[0.5,null]}]", "inference.size_prior=1"]
    settings, _ = read_config(composed(*TINY, *words))
    folder = computed(settings, tmp_path).folder
    assert len(pd.read_csv(folder / "hypotheses.csv")) == len(settings.candidates)
    assert set(pd.read_csv(folder / "attempts.csv")["outcome"]) <= {"kept", "goal_missed"}


def test_truth_without_distance_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "halves.py").write_text(
        "import mlci\n\ndef right():\n    return mlci.Predicate(lambda x: x[..., 0] > 3.2)\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    with pytest.raises(Exception, match=r"truth\.shapes: region truth_0 knows what is inside, but"):
        read_config(composed("truth.boxes=[]", "truth.shapes=[{_target_:halves.right}]"))
    sys.modules.pop("halves", None)
