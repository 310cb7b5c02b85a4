"""Most probable areas of rankings whose areas can be told by hand."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from mlci.best_areas import area_scores, most_probable_area

LINE = sparse.csr_matrix(np.eye(6, k=1) + np.eye(6, k=-1) + np.eye(6))
GOOD = np.array([False, True, False, False, False, True])


def test_areas_on_a_line() -> None:
    gains = np.array(
        [
            [0.0, 3.0, 2.5, 0.0, 2.9, 0.0],  # 1 and 2; 4 is as good but apart
            [0.0, 1.0, 2.5, 2.4, 2.9, 1.0],  # 2, 3 and 4
            [3.0, -np.inf, 2.5, -np.inf, 3.0, 2.5],  # 0 alone, and 4 with 5: a tie
            [np.inf, np.inf, 7.0, -np.inf, 3.0, 2.5],  # 0 and 1
            [-np.inf] * 6,  # everything: nothing is known
        ]
    )
    scores = area_scores(gains, LINE, GOOD)
    np.testing.assert_allclose(scores.overlap, [1, 0, 0.5, 1, 1])
    np.testing.assert_allclose(scores.precision, [0.5, 0, 0.25, 0.5, 2 / 6])
    np.testing.assert_allclose(scores.share, [2 / 6, 3 / 6, 1.5 / 6, 2 / 6, 1])


def test_a_wider_margin_joins_more() -> None:
    gains = np.array([[0.0, 3.0, 2.0, 0.0, 0.0, 0.0]])
    assert area_scores(gains, LINE, GOOD).share[0] == 1 / 6
    assert area_scores(gains, LINE, GOOD, below=1.5).share[0] == 2 / 6


def test_the_area_of_the_first_best_region() -> None:
    gain = np.array([0.0, 3.0, 2.5, 0.0, 3.0, 0.0])
    assert np.flatnonzero(most_probable_area(gain, LINE)).tolist() == [1, 2]
