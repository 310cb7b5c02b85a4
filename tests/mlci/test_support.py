"""What the first region rests on, against ranking the other demonstrations anew."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.evidence import PAPER, Rates
from mlci.inference import Inference
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace
from mlci.support import support

SPACE = StateSpace(Box([0.0], [9.0]), [False], ("place",))


def inference(avoidance: np.ndarray, violated: np.ndarray, rates: Rates = PAPER) -> Inference:
    count, regions = np.shape(avoidance)
    return Inference(
        Regions.from_grid(SPACE, (regions,)),
        tuple(f"path {j}" for j in range(count)),
        np.asarray(avoidance, dtype=float),
        np.asarray(violated, dtype=bool),
        np.ones(count, dtype=bool),
        rates=rates,
    )


def test_shares_by_hand() -> None:
    """Gains ln 2, ln 8, 0 of the first region: a quarter, three quarters, nothing."""
    avoidance = np.array([[0.5, 1.0], [0.125, 1.0], [1.0, 0.2]])
    result = support(inference(avoidance, np.zeros((3, 2))))
    assert result.region == 0
    np.testing.assert_allclose(result.share, [0.25, 0.75, 0.0])
    assert result.carriers().tolist() == [1]
    assert result.carriers(0.75).tolist() == [1]
    assert result.carriers(0.76).tolist() == [1, 0]
    # Without the second, ln 2 against ln 5.
    assert result.first_without.tolist() == [0, 1, 0]
    assert result.stays.tolist() == [True, False, True]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("rates", [PAPER, Rates(0.1, 0.05)])
def test_leaving_one_out_is_the_ranking_of_the_others(seed: int, rates: Rates) -> None:
    rng = np.random.default_rng(seed)
    each = inference(rng.random((6, 5)) ** 2, rng.random((6, 5)) < 0.1, rates)
    result = support(each)
    assert result.region == each.order[0]
    for j in range(6):
        others = each.of(np.delete(np.arange(6), j))
        assert result.first_without[j] == others.order[0]
    brings = np.maximum(each.evidence[:, result.region], 0)
    np.testing.assert_allclose(result.share, brings / brings.sum())


def test_a_tie_leaves_the_first_region_first() -> None:
    """Two regions whose gains differ by rounding alone once the first demonstration is gone."""
    both = [[0.9, 0.5], [0.5, 0.7], [0.7, 0.9], [0.3, 0.3]]
    each = inference(np.array([[0.5, 1.0], *both]), np.zeros((5, 2)))
    assert 0 < np.diff(each.of([1, 2, 3, 4]).gain)[0] < 1e-14
    result = support(each)
    assert (result.region, result.first_without.tolist()) == (0, [0] * 5)


def test_infinite_evidence_outweighs_the_rest() -> None:
    avoidance = np.array([[0.0, 1.0], [0.1, 0.01], [0.0, 1.0], [0.5, 1.0]])
    result = support(inference(avoidance, np.zeros((4, 2))))
    np.testing.assert_allclose(result.share, [0.5, 0, 0.5, 0])
    assert result.stays.all()
    alone = support(inference(avoidance[:2], np.zeros((2, 2))))
    assert alone.first_without.tolist() == [1, 0]


def test_nothing_carries_what_has_no_gain() -> None:
    result = support(inference(np.ones((2, 3)), np.zeros((2, 3))))
    assert not result.share.any()
    assert not len(result.carriers())
    assert result.stays.all()
    refuted = support(inference(np.full((2, 3), 0.5), np.ones((2, 3))))
    assert not refuted.share.any()
    assert not len(support(inference(np.ones((0, 3)), np.zeros((0, 3)))).share)
    with pytest.raises(ValueError, match="without hypotheses no region comes first"):
        support(
            Inference(
                Regions.from_boxes(SPACE, []), ("a",), np.ones((1, 0)), np.ones((1, 0), bool),
                np.ones(1, bool),
            )
        )  # fmt: skip


def test_rounding_decides_neither_who_carries_nor_who_is_next() -> None:
    """Two demonstrations that bring the same, and two regions that tie without the first."""
    near = np.nextafter(0.5, [0, 0.5, 1])
    assert len({support(inference([[a], [0.5]], np.zeros((2, 1)))).share[0] for a in near}) > 1
    for a in near:
        assert support(inference([[a], [0.5]], np.zeros((2, 1)))).carriers(0.8).tolist() == [0, 1]
        assert support(inference([[a], [0.5]], np.zeros((2, 1)))).carriers(0.4).tolist() == [0]
        each = inference([[1e-9, 1.0, 1.0], [1.0, 0.5, a]], np.zeros((2, 3)))
        assert support(each).first_without.tolist() == [1, 0]
