"""Functions of states and controls in a config: the example of conf/README.md, and refusals."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tiny_point import TINY, composed, computed

from experiments.config.paths import CONF
from experiments.config.problems import ConfigError
from experiments.config.read import read_config, settings_of_record
from experiments.tracking.trees import plain

SECTION = (CONF / "README.md").read_text().split("\n## Hypotheses about controls of your own\n")[1]
(MODULE,) = re.findall(r"^```python\n(.*?)^```", SECTION, flags=re.MULTILINE | re.DOTALL)[:1]
KEY = "hypotheses.controls.predicates"
CART = (*TINY, "system=double_integrator", "actions=6")
OTHERS = """
def broken():
    return lambda states, controls: controls[..., 7] > 0

def never():
    return lambda states, controls: controls[..., 0] > 1e9

def shapeless():
    return lambda states, controls: True

def number(): return 3

def failing(): raise RuntimeError("no joint")

word = "push"
"""


@pytest.fixture
def joint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A folder with the README's module, and with others."""
    (tmp_path / "joint.py").write_text(MODULE + OTHERS)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    sys.modules.pop("joint", None)


@pytest.mark.usefixtures("joint")
def test_ranges_come_first_and_predicates_after_them() -> None:
    words = ["hypotheses.controls.shares=[0.5]"]
    words.append(f"{KEY}=[{{_target_:joint.push_while_rising,above:0.5}}]")
    settings = read_config(composed(*CART, *words))[0]
    hypotheses = settings.hypotheses.controls.hypotheses(settings.model)
    assert hypotheses.names[2:] == ("push_while_rising (above=0.5)",)
    assert hypotheses.uses_states
    states = np.array([[0.0, 1.0], [0.0, -1.0], [0.0, 1.0]])
    held = hypotheses.holds(states, np.array([[0.6], [0.6], [-0.6]]))
    assert held.tolist() == [[True, False, True], [True, False, False], [False, True, False]]
    assert settings_of_record(plain(settings)).hypotheses == settings.hypotheses


def test_a_point_ranks_a_predicate(joint: Path) -> None:
    words = [f"{KEY}=[{{_target_:joint.push_while_rising,above:0.5}}]"]
    words += ["hypotheses.controls.both=0.2"]
    folder = computed(read_config(composed(*CART, *words))[0], joint / "results").folder
    ranked = pd.read_csv(folder / "controls.csv")
    assert ranked["name"].tolist() == ["push_while_rising (above=0.5)"]
    assert not ranked["is_truth"].any()
    pairs = pd.read_csv(folder / "joint.csv")
    assert set(pairs["controls"]) == {"push_while_rising (above=0.5)", "-"}


@pytest.mark.usefixtures("joint")
@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("{}", f"{KEY}[0]._target_: missing; name a function that returns one of states and"),
        ("{_target_:joint.nothing}", "joint.py defines no nothing"),
        ("{_target_:joint.word}", "'joint.word' is no function"),
        ("{_target_:joint.push_while_rising}", f"{KEY}[0].above: missing"),
        ("{_target_:joint.never,above:1}", f"{KEY}[0].above"),
        ("{_target_:joint.number}", "joint.number must return a function of states (..., n) and"),
        ("{_target_:joint.failing}", "joint.failing fails: RuntimeError: no joint"),
        (
            "{_target_:joint.broken}",
            f"{KEY}[0]: control predicate broken fails for states (4096, 2",
        ),
        ("{_target_:joint.shapeless}", "must return a truth value or a level a pair, of shape"),
        ("{_target_:joint.never}", f"{KEY}[0]: never forbids none of the 6 actions in any of 1000"),
        (
            "{_target_:joint.broken},{_target_:joint.broken}",
            "2 functions need as many different names",
        ),
    ],
)
def test_what_is_no_predicate_is_refused(value: str, message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        read_config(composed(*CART, f"{KEY}=[{value}]"))


def test_both_needs_something_about_controls() -> None:
    with pytest.raises(
        ConfigError, match=r"controls\.both: 0\.3, but nothing about controls may be"
    ):
        read_config(composed(*CART, "hypotheses.controls.both=0.3"))
