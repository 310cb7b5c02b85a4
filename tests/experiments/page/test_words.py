"""Sentences of the page."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from page_answers import CIRCLE, answer_of

from experiments.page.words import next_sentences, of_100
from mlci.demonstrations import Task
from mlci.next_task import NextTask
from mlci.regions import Regions
from mlci.spaces import Box


@pytest.mark.parametrize(
    ("probability", "words"),
    [
        (0.0, "0 of 100"),
        (0.00049, "under 0.1 of 100"),
        (0.0005, "0.1 of 100"),
        (0.5, "50.0 of 100"),
        (0.9994, "99.9 of 100"),
        (0.9995, "over 99.9 of 100"),
        (1 - 1e-12, "over 99.9 of 100"),
        (1.0, "100 of 100"),
    ],
)
def test_only_what_is_certain_is_none_or_all_of_100(probability: float, words: str) -> None:
    assert of_100(probability) == words


def test_the_nearest_regions_come_first_in_shares_of_the_bounds_and_round_the_circle() -> None:
    """A cell is a quarter of the angle, 1.6 rad, and a fifth of the speed, 2.4 rad/s."""
    regions = Regions.from_grid(CIRCLE, (4, 5))
    answer, _ = answer_of(regions, ["a", "b"])
    answer = dataclasses.replace(
        answer,
        support=dataclasses.replace(answer.support, region=2),
        unseen=np.array([3, 7, 12, 17]),  # above, beside, opposite, and beside across the seam
    )
    named = re.findall(r"region (\d+) \(", next_sentences(answer)[-1])
    assert named == ["3", "7", "17", "12"]


def test_the_next_tasks_are_named_with_their_units() -> None:
    answer, _ = answer_of(Regions.from_grid(CIRCLE, (4, 5)), ["a", "b"])
    task = Task(np.array([0.5, 0.0]), Box([3.0, -np.inf], [3.5, np.inf]), 5.0)
    chosen = NextTask(task, 7, "reach", 0.21, 0.01, 0.34)
    sentences = next_sentences(dataclasses.replace(answer, next_tasks=(chosen,)))
    assert sentences[:-3] == next_sentences(answer)
    assert sentences[-2] == (
        "Task reach, from angle 0.5 rad, speed 0 rad/s to angle 3 to 3.5 rad in 5 s: 34.0 of 100 "
        "(expected information 0.210 nat)."
    )
    assert "at most one region is forbidden" in sentences[-1]
