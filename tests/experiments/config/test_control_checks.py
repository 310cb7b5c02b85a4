"""Constraints on controls that a config cannot mean, each refused with its key and the way out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml
from tiny_point import composed

from experiments.config.problems import ConfigError
from experiments.config.read import read_config, read_recorded_config
from experiments.config.settings import Settings

RANGES = "hypotheses.controls.ranges"
PUSH = "weak_push"


def settings_of(*words: str, truth: str = PUSH) -> Settings:
    return read_config(changed(composed(f"truth={truth}"), *words))[0]


def changed(tree: dict[str, Any], *words: str) -> dict[str, Any]:
    """A config with some values, each written `key=YAML`; to compose it anew would take longer."""
    for word in words:
        key, _, value = word.partition("=")
        *groups, name = key.split(".")
        group = tree
        for each in groups:
            group = group[each]
        group[name] = yaml.safe_load(value)
    return tree


def ranges(key: str, *ends: str) -> str:
    """A list of ranges of controls, each written `lower upper`."""
    pairs = [each.split() for each in ends]
    return f"{key}=[{', '.join(f'{{lower: [{low}], upper: [{high}]}}' for low, high in pairs)}]"


@pytest.mark.parametrize(
    ("words", "limit"),
    [
        ((), (-np.inf, 0.5)),
        (("demonstrations.clip=true",), (-2.0, 0.5)),
        # The second range cuts off the other end, and a third one less than the first.
        ((ranges("truth.controls", "0.5 null", "null -1", "1 null"),), (-1.0, 0.5)),
        # With ends of the control range, one beyond them is at an end.
        (("demonstrations.clip=true", ranges("truth.controls", "1 9")), (-2.0, 1.0)),
    ],
)
def test_limit_is_what_the_truth_leaves(words, limit) -> None:
    box = settings_of(*words).control_limit
    assert box is not None
    assert (box.lower[0], box.upper[0]) == limit


def test_regions_limit_no_control() -> None:
    assert settings_of(truth="c1").control_limit is None
    clipped = settings_of("demonstrations.clip=true", truth="c1").control_limit
    assert clipped is not None
    assert clipped.upper.tolist() == [2.0]


@pytest.mark.parametrize(
    ("word", "message"),
    [
        (
            ranges("truth.controls", "0.5 1"),
            "truth.controls: control 1 from 0.5 to 1 leaves no interval of each control, from "
            "[-inf] to [inf]: it must cut off one end of one control; with "
            "demonstrations.clip=true the control range has ends",
        ),
        (ranges("truth.controls", "0.5 null", "null 0.7"), "control 1 below 0.7 leaves no"),
        (ranges("truth.controls", "1 0.5"), "truth.controls[0]: control 1 from 1.0 to 0.5; lower"),
        (ranges("truth.controls", "2 null"), "holds nothing of control 1, which goes from -2 to 2"),
        (ranges("truth.controls", "null null"), "truth.controls[0]: holds every control"),
        (
            ranges("hypotheses.controls.ranges", "-9 9"),
            "hypotheses.controls.ranges[0]: holds every control from [-2.0] to [2.0]; give it an",
        ),
        (
            ranges("truth.controls", "0.5 null", "0.5 null"),
            "truth.controls: a range is given twice",
        ),
        (ranges("truth.controls", "0.5,1 null"), "[0.5, 1.0] must have 1 entries, one a control"),
        ("truth.controls=[3]", "3 is not a range of controls; write its ends"),
        ("truth.controls=[{lower: [1.0]}]", "truth.controls[0].upper: missing"),
        ("truth.controls=[{lower: [1.0], upper: [high]}]", "'high' is not a finite number"),
        ("truth.controls=[]", "give at least one box, with lower and upper, or another region, a"),
        ("tasks.crossing=true", "tasks.crossing: true, but no truth is there to cross"),
        ("soft.weights=[1.0]", "soft.weights: [1.0], but no truth is there to ask about"),
        ("calibration.sets=3", "the prior knows no such truth"),
        ("truth.name=none", "truth.name: none means that nothing is forbidden"),
        (ranges(RANGES, "0.1 0.2"), "control 1 from 0.1 to 0.2 holds none of the 9 actions"),
        (ranges(RANGES, "1,2 null,null"), f"{RANGES}[0].lower: [1.0, 2.0] must have 1 entries"),
        (ranges(RANGES, "null -2"), f"{RANGES}[0]: holds nothing of control 1"),
        ("hypotheses.controls.shares=[0.5,0.5]", "need as many different names"),
        ("hypotheses.controls.shares=[1.0]", "hypotheses.controls.shares[0]: 1.0 must be below 1"),
        ("hypotheses.controls.tolerance=1", "hypotheses.controls.tolerance: 1.0 must be below 1"),
        ("hypotheses.controls.share=[0.5]", "unknown key; did you mean shares?"),
    ],
)
def test_what_cannot_be_is_refused(word: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        settings_of(word)
    assert message in str(error.value)
    assert len(str(error.value).splitlines()) < 3


def test_a_range_may_be_named_by_its_share_or_its_ends_but_once() -> None:
    with pytest.raises(ConfigError, match="name each once, by ranges, by shares or by pred"):
        settings_of(ranges(RANGES, "1 null"), "hypotheses.controls.shares=[0.5]")


def test_recorded_demonstrations_are_asked_the_same() -> None:
    tree = composed("demonstrations=recorded", name="infer")
    with pytest.raises(ConfigError, match="holds none of the 9 actions"):
        read_recorded_config(changed(tree, ranges(RANGES, "0.1 0.2")))
