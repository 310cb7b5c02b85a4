"""Sentences of the page."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from page_answers import CIRCLE, answer_of

from experiments.page.words import next_sentences, of_100
from mlci.regions import Regions


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
