"""What is printed: the answer first, in lines of 80 columns that break between words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from experiments.console import answer_lines, bounds, measure_lines, probability
from experiments.page.words import where
from experiments.terminal import entry
from mlci.answers import Answer
from mlci.demonstrations import Task
from mlci.evidence import PAPER, Rates
from mlci.inference import Inference
from mlci.misfit import Misfit
from mlci.next_task import NextTask
from mlci.regions import Regions
from mlci.shapes.balls import Ball
from mlci.spaces import Box, StateSpace
from mlci.support import support

PLANE = StateSpace(
    Box([0.0, -6.0], [6.0, 6.0]), [True, False], ("angle", "angular_velocity"), ("rad", "rad/s")
)
NAMES = ("angle", "angular_velocity", "length", "length_velocity")
BODY = StateSpace(
    Box([-1.2345] * 4, [1.2345] * 4), [False] * 4, NAMES, ("rad", "rad/s", "dm", "dm/s")
)


def answer(
    space: StateSpace,
    shape: Sequence[int | None],
    alpha: Sequence[Sequence[float]],
    violated: Sequence[int] = (),
    rates: Rates = PAPER,
) -> Answer:
    """An answer from probabilities of avoiding; the first demonstration violates some regions."""
    hypotheses, avoidance = (
        Regions.from_grid(space, shape),
        np.ones((len(alpha), np.prod([k or 1 for k in shape]))),
    )
    avoidance[:, : len(alpha[0])] = alpha
    refuted = np.zeros(avoidance.shape, dtype=bool)
    refuted[0, list(violated)] = True
    names = tuple(f"demonstration_of_the_{j}th_person" for j in range(len(alpha)))
    inference = Inference(
        hypotheses, names, avoidance, refuted, np.ones(len(alpha), bool), rates=rates
    )
    count = len(alpha)
    return Answer(
        inference,
        support(inference),
        Misfit(np.zeros(count, int), np.zeros(count), *[np.ones(count)] * 4),
        np.arange(0),
        np.zeros((len(hypotheses), space.dimension), bool),
        1.0,
        True,
    )


def test_the_answer_word_by_word() -> None:
    each = answer(PLANE, (6, 2), [[0.02, 0.5, 0.02], [0.02, 1, 0.5], [0.5, 1, 0.9]], [5])
    assert list(answer_lines(each, 3, [2])) == [
        "answer          region 0 is the most likely, with probability 0.974; no",
        "                constraint 0.002",
        "  region   gain  posterior  angle   angular velocity",
        "          [nat]             [rad]   [rad/s]",
        "  0       8.517      0.974  0 to 1  -6 to 0",
        "  2       4.711      0.022  1 to 2  -6 to 0           (truth)",
        "  1       0.693     <0.001  0 to 1  0 to 6",
        "95 % credible   1 region in 1 area:",
        "                0.974 in 0: angle 0 to 1 rad, angular velocity -6 to 0 rad/s",
        "assumed         at most one region is forbidden; prior of none 0.5, the rest",
        "                shared equally; model error 0; rule breaking 0; temperature 1;",
        "                paths begin and end at states; every crossing of a region counts",
        "rests on        2 of 3 demonstrations, which bring half of the gain of 0:",
        "                demonstration_of_the_0th_person 46 %,",
        "                demonstration_of_the_1th_person 46 %",
        "                0 stays first whichever demonstration is left out",
    ]


def test_what_is_printed_where_there_is_little_to_say() -> None:
    """No gain at all; one demonstration; another region without it; many areas."""
    text = said(answer(PLANE, (6, 2), [[1.0]]))
    assert "no region is more likely than none, whose probability is 0.5" in text
    assert "rests on nothing: no demonstration speaks for 0" in text
    assert "one demonstration alone, which cannot be left out" in text
    assert "95 % credible no constraint and 11 regions in 1 area:" in text
    text = said(answer(PLANE, (6, 2), [[0.01, 1.0], [1.0, 0.1]]))
    assert (
        "0 stays first when any but 1 of 2 demonstrations is left out; what comes first then: "
        "1 without demonstration_of_the_0th_person"
    ) in text
    apart = np.where(np.isin(np.arange(25), [0, 2, 10, 12, 20]), 1e-4, 1.0).tolist()
    text = said(answer(BODY, (None, 5, 5, None), [apart]))
    assert "5 regions in 5 areas:" in text
    assert "and 2 more" in text


def said(each: Answer) -> str:
    """All that is printed, with single spaces."""
    return " ".join(" ".join(answer_lines(each, 5)).split())


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0.0, "0"), (1.0, "1"), (1e-9, "<0.001"), (0.00049, "<0.001"), (0.0005, "0.001"),
        (0.5, "0.500"), (0.99949, "0.999"), (0.9996, ">0.999"),
    ],
)  # fmt: skip
def test_a_probability_is_not_rounded_to_certainty(value: float, words: str) -> None:
    assert probability(value) == words


def test_what_to_record_next_is_printed_with_units() -> None:
    task = Task(np.array([0.5, 0.0]), Box([3.0, -np.inf], [3.5, np.inf]), 5.0)
    chosen = NextTask(task, 7, "reach", 0.21, 0.01, 0.34)
    told = replace(answer(PLANE, (2, 2), [[0.5]]), next_tasks=(chosen,))
    words = " ".join(" ".join(answer_lines(told, 3)).split())
    assert (
        "record next task reach: from angle 0.5 rad, angular velocity 0 rad/s to angle 3 to 3.5 "
        "rad in 5 s: 0.210 nat expected, tells something with probability 0.340 as far as at "
        "most one"
    ) in words


def test_regions_that_are_no_boxes_are_told_to_lie_within_their_bounds() -> None:
    boxes = answer(PLANE, (2, 1), [[0.5, 0.9]])
    shapes = [Ball([2.0, 0.0], [0.5, 1.0]), Box([0.0, -6.0], [1.0, 0.0])]
    regions = Regions.from_shapes(PLANE, shapes)
    shaped = replace(boxes, inference=replace(boxes.inference, hypotheses=regions))
    lines = list(answer_lines(shaped, 2))
    assert "                no boxes, but shapes within the bounds above: 0" in lines
    assert where(regions, 0) == "within angle 1.5 to 2.5 rad, angular velocity -1 to 1 rad/s"
    assert where(regions, 1) == "angle 0 to 1 rad, angular velocity -6 to 0 rad/s"


def test_a_box_in_words() -> None:
    assert bounds(Box([1.0, -np.inf], [2.5, np.inf]), PLANE) == "angle 1 to 2.5 rad"
    assert bounds(Box([-np.inf] * 2, [np.inf] * 2), PLANE) == "everywhere"


def test_an_entry_keeps_words_whole() -> None:
    lines = entry("title", f"{'long-word ' * 9}{'x' * 90}", hang=2)
    assert lines[0].startswith("title           long-word")
    assert lines[1].startswith(" " * 18 + "long-word")
    assert lines[-1] == " " * 18 + "x" * 90


def test_nothing_is_wider_than_the_terminal_or_broken_inside_a_word() -> None:
    """With columns for two dimensions, and with bounds below each region for four."""
    for space, shape in ((PLANE, (6, 2)), (BODY, (3, 3, 3, 3))):
        each = answer(space, shape, [[0.0, 0.5, 0.02], [0.2, 1, 0.5], [0.5, 1, 0.9]], [5])
        lines = list(answer_lines(each, 5, [0]))
        assert max(map(len, lines)) <= 80
        text = " ".join(" ".join(lines).split())
        for word in (*each.inference.names[:1], "unavoidable", "(truth)", "angular velocity"):
            assert word in text
        assert not [line for line in lines if line != line.rstrip()]


def test_what_is_not_measured_is_said_in_words() -> None:
    names = ("final_state_error", "violation_distance", "violation_floor")
    summary = pd.Series({**dict.fromkeys(names, np.nan), "feasible": 0})
    summary["violation_distance_pooled"] = np.nan
    ranks = pd.DataFrame({"rank": [np.nan], "demonstrations": [1]})
    text = " ".join(" ".join(measure_lines(summary, ranks, 5)).split())
    assert "since rollouts=0 or the tabular agent can reach no goal" in text
    assert "nan" not in text
    summary[:] = 1.5
    assert "error 1.500; violation" in " ".join(measure_lines(summary, ranks, 5))
