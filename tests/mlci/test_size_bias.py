"""Larger regions explain more: it is noticed, and a prior by size weighs against it."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.evidence import Rates
from mlci.inference import Inference
from mlci.region_sizes import region_sizes, weights_by_size
from mlci.regions import Regions
from mlci.shapes.balls import Ball
from mlci.size_bias import size_bias
from mlci.spaces import Box, StateSpace

PLANE = StateSpace(Box([-2, -2], [2, 2]), [False, False], ("x", "y"))
# The same place three times, each four times as large as the one before; the last is elsewhere.
NESTED = [Box([0, 0], [side, side]) for side in (0.5, 1.0, 2.0)]
REGIONS = Regions.from_shapes(PLANE, [*NESTED, Ball([-1, -1], 0.4)], ("s", "m", "l", "ball"))


def inferred(avoidance: list[float], size_prior: float = 0.0, count: int = 3) -> Inference:
    """From demonstrations that violate nothing, each with the same alpha of the regions."""
    alpha = np.tile(avoidance, (count, 1))
    names = tuple(map(str, range(count)))
    nothing = np.zeros(alpha.shape, dtype=bool)
    reachable = np.ones(count, dtype=bool)
    return Inference(
        REGIONS, names, alpha, nothing, reachable, rates=Rates(0.0), size_prior=size_prior
    )


def test_sizes_and_weights() -> None:
    sizes = region_sizes(REGIONS)
    assert sizes[:3] == pytest.approx([1 / 64, 1 / 16, 1 / 4])
    assert sizes[3] == pytest.approx(np.pi * 0.16 / 16, rel=5e-3)
    assert weights_by_size(REGIONS, 0.0) is None
    for power in (1.0, 0.5):
        weights = weights_by_size(REGIONS, power)
        assert weights is not None
        np.testing.assert_allclose(weights, sizes**-power)
    with pytest.raises(ValueError, match="lies between 0 and 20, not -1"):
        weights_by_size(REGIONS, -1.0)
    assert np.all(np.isfinite(weights_by_size(REGIONS, 20.0)))
    with pytest.raises(ValueError, match="lies between 0 and 20, not 1000000000"):
        weights_by_size(REGIONS, 1e9)


@pytest.mark.parametrize(
    "tiny", [Box([0, 0], [1e-300, 1e-300]), Box([0, 0], [1e-9, 1e-9]), Ball([0, 0], 1e-10)]
)
def test_a_region_too_small_to_have_a_size_is_named(tiny: Box | Ball) -> None:
    """It is in the way of paths as others are; only a region outside the bounds has no weight."""
    regions = Regions.from_shapes(PLANE, [NESTED[0], tiny], ("large", "tiny"))
    with pytest.raises(ValueError, match=r"region tiny holds .* less than the 1e-15"):
        weights_by_size(regions, 0.5)
    outside = Regions.from_boxes(PLANE, [NESTED[0], Box([5, 5], [6, 6])])
    weights = weights_by_size(outside, 0.5)
    np.testing.assert_allclose(weights, [8.0, 0.0])


def test_posterior_has_the_prior_by_size() -> None:
    alpha = [0.5, 0.45, 0.4, 0.9]
    equal, weighed = inferred(alpha), inferred(alpha, 1.0)
    assert [REGIONS.names[i] for i in equal.order] == ["l", "m", "s", "ball"]
    assert [REGIONS.names[i] for i in weighed.order] == ["s", "m", "l", "ball"]
    np.testing.assert_array_equal(equal.gain, weighed.gain)
    # By hand: prior times likelihood.
    weight = np.append(0.5 / region_sizes(REGIONS) / np.sum(1 / region_sizes(REGIONS)), 0.5)
    expected = weight * np.append(np.array(alpha) ** -3.0, 1.0)
    expected /= np.sum(expected)
    np.testing.assert_allclose(weighed.posterior, expected[:-1])
    assert weighed.posterior_none == pytest.approx(expected[-1])
    # It stays with a part of the demonstrations.
    assert weighed.of([0]).size_prior == 1.0


def test_bias_is_reported_where_a_large_region_comes_first() -> None:
    bias = size_bias(inferred([0.5, 0.45, 0.4, 0.9]))
    assert bias is not None
    assert (bias.first, bias.by_size) == ("l", "s")
    assert bias.ratio == pytest.approx(8, rel=0.01)  # the median of the others is the ball's
    # Ranks of sizes 1 (s), 3 (m), 4 (l), 2 (ball) against those of gains 2, 3, 4, 1.
    assert bias.correlation == pytest.approx(0.8)
    assert "region l, which comes first, is" in bias.warnings[0]
    assert "s comes first" in bias.warnings[0]
    assert bias.record()["first_by_size"] == "s"


def test_nothing_is_reported_without_a_bias() -> None:
    small = size_bias(inferred([0.1, 0.45, 0.4, 0.9]))
    assert small is not None
    assert small.warnings == []
    weighed = size_bias(inferred([0.5, 0.45, 0.01, 0.9], 1.0))
    assert weighed is not None
    assert weighed.first == "l"
    assert weighed.warnings == []  # it comes first against its prior
    still = size_bias(inferred([0.5, 0.45, 0.01, 0.9]))
    assert still is not None
    assert "it still comes first" in still.warnings[0]


def test_regions_of_one_size_have_no_bias() -> None:
    grid = Regions.from_grid(PLANE, (3, 3))
    nothing = np.zeros((1, 9), dtype=bool)
    even = Inference(grid, ("a",), np.full((1, 9), 0.5), nothing, np.ones(1, dtype=bool))
    assert size_bias(even) is None
