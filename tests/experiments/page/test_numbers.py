"""The numbers behind the page are those of the inference, after each number of demonstrations."""

from __future__ import annotations

import numpy as np
import pytest
from page_answers import CIRCLE, answer_of

from experiments.page import numbers
from experiments.page.numbers import nats, page_numbers, shares
from mlci.evidence import Rates
from mlci.regions import Regions

REGIONS = Regions.from_grid(CIRCLE, (4, 5))
NAMES = [f"d{j}" for j in range(6)]


@pytest.mark.parametrize("rates", [Rates(0.1), Rates(0.1, 0.05)])
def test_each_stop_of_the_slider_has_the_ranking_of_that_many(rates: Rates) -> None:
    answer, _ = answer_of(REGIONS, NAMES, rates)
    tree = page_numbers(answer)
    assert tree["stops"] == list(range(7))
    for k in tree["stops"]:
        part = answer.inference.of(slice(k))
        assert tree["rank"][k] == part.ranking.rank.tolist()
        assert tree["none"][k] == round(1000 * part.posterior_none)
        for i, gain in enumerate(part.gain):
            shown = tree["gain"][k][i]
            assert shown is None if gain == -np.inf else abs(shown / 1000 - gain) <= 5.1e-4
    assert tree["top"] == round(
        1000 * answer.inference.gain[np.isfinite(answer.inference.gain)].max()
    )


def test_pairs_say_why() -> None:
    answer, _ = answer_of(REGIONS, NAMES)
    tree, inference = page_numbers(answer), answer.inference
    assert tree["entered"] == [np.flatnonzero(row).tolist() for row in inference.violated]
    assert tree["reachable"] == [True, False, True, True, True, True]
    assert tree["decided"] == [[0], [], [], [], [], []]
    assert len(REGIONS) - 1 in tree["unseen"] or inference.violated[:, -1].any()
    assert tree["phi"][2][3] == round(1000 * inference.phi[2, 3])
    assert "forecast" not in tree


def test_no_probability_is_rounded_to_none_or_all() -> None:
    assert shares([0, 1e-9, 0.0004, 0.0006, 0.5, 0.9994, 0.9996, 1]) == [
        *(0, -1, -1, 1, 500, 999, 1001, 1000)
    ]
    assert nats([[-np.inf, np.inf], [0.0014, -2.0]]) == [[None, "inf"], [1, -2000]]


def test_large_answers_stay_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numbers, "MOST_NUMBERS", 60)
    answer, _ = answer_of(REGIONS, NAMES)
    tree = page_numbers(answer)
    assert tree["stops"] == [0, 3, 6]
    assert sorted(tree["detailed"]) == sorted(answer.inference.order[:10].tolist())
    assert len(tree["phi"][0]) == len(tree["evidence"][0]) == 10
