"""The rule that is kept for the advisor: what it says, and what it came from."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from dynamics_study import dynamics

from experiments import success_rule as command
from experiments.collate.success_rule import success_tables
from experiments.success_rule import chance_word, chance_words, kept_rule, read_rule
from mlci.diagnosis import Diagnosis
from mlci.outlook.outlook import FEATURES, Outlook

KNOWN = Outlook(
    diagnosis=Diagnosis(0.0, 0.0, 2.0, (0.1, 0.2)),
    reach=np.array([1.5, 0.8]),
    expansion=0.5,
    reachable=np.array([True, True, True, False]),
    entered=np.array([[1, 0, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=bool),
    ends=np.zeros((4, 3), dtype=bool),
    phi=np.array([[0.9, 0.1, 0.0], [0.1, 0.0, 0.0], [0.8, 0.7, 0.0], [0.0, 0.0, 0.0]]),
    detours=lambda truth, tasks: np.zeros((len(tasks), 3), dtype=bool),
)


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A folder of the study's tables."""
    folder = tmp_path / "dynamics"
    (folder / "tables").mkdir(parents=True)
    table = dynamics()
    for name, frame in {"dynamics": table, **success_tables(table)}.items():
        frame.to_csv(folder / "tables" / f"{name}.csv", index=False)
    return folder


def test_what_is_kept_says_what_the_tables_say(study: Path, tmp_path: Path) -> None:
    path = tmp_path / "rule.json"
    path.write_text(json.dumps(kept_rule(study)))
    rule, table = read_rule(path), pd.read_csv(study / "tables" / "success_rule.csv")
    assert rule.features == tuple(table["feature"][:-1])
    assert (rule.top, rule.demonstrations, rule.systems, rule.points) == (5, 9, 5, 40)
    columns = [FEATURES.index(name) for name in rule.features]
    numbers = KNOWN.features([0, 1], 9, 5)[:, columns]  # no task would enter the third region
    z = (numbers - table["mean"][:-1].to_numpy()) / table["scale"][:-1].to_numpy()
    logits = table["weight"].iloc[-1] + z @ table["weight"][:-1].to_numpy()
    np.testing.assert_allclose(rule.chances(KNOWN), 1 / (1 + np.exp(-logits)), atol=1e-5)
    assert chance_word(KNOWN, rule) == f"{rule.chances(KNOWN).mean():.0%}"


def test_the_words_say_on_what_it_rests(study: Path, tmp_path: Path) -> None:
    path = tmp_path / "rule.json"
    path.write_text(json.dumps(kept_rule(study)))
    rule = read_rule(path)
    text = " ".join(chance_words(KNOWN, rule))
    assert "a truth is among the first 5 of 3 hypotheses after 9 demonstrations" in text
    assert "most of the 2 hypotheses" in text
    assert "This rests on 40 simulated studies of 5 systems" in text
    assert "reach" in text
    assert "do not lean on it" not in text
    weak = replace(rule, rule_less={**rule.rule_less, "base_rate": (-0.01, -0.03, 0.01)})
    assert "not surely better than the base rate: do not lean on it" in " ".join(
        chance_words(KNOWN, weak)
    )
    far = replace(rule, most=rule.least + 1e-6)
    assert "is beyond all that was tried there" in " ".join(chance_words(KNOWN, far))
    nothing = replace(KNOWN, entered=np.zeros((4, 3), dtype=bool))
    assert chance_words(nothing, rule) == [
        "of no hypothesis it can be told: none is entered by a tenth of the tasks"
    ]
    assert chance_word(nothing, rule) == chance_word(None, rule) == "-"


def test_the_rule_that_comes_with_the_code_can_be_read() -> None:
    rule = read_rule()
    assert set(rule.features) <= set(FEATURES)
    assert rule.systems >= 3
    assert np.all((rule.chances(KNOWN) > 0) & (rule.chances(KNOWN) < 1))


def test_without_the_study_the_command_says_what_to_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["success_rule", str(tmp_path)])
    assert command.main() == 1
    assert "run python experiments/run.py -m experiment=dynamics first" in capsys.readouterr().err
