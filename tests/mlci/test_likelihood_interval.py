"""The interval of a likelihood against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from mlci.likelihood_interval import DROP, likelihood_interval

GRID = np.linspace(-4.0, 4.0, 9)
Z = 1.959963984540054  # of the normal distribution, 97.5 %


def test_the_drop_is_half_the_quantile_of_chi_squared() -> None:
    assert pytest.approx(chi2.ppf(0.95, 1) / 2, rel=1e-14) == DROP


@pytest.mark.parametrize("width", [1.0, 0.1])  # the second is narrower than a step of the grid
@pytest.mark.parametrize("middle", [0.3, -1.4, 2.0])
def test_of_a_normal_likelihood(middle: float, width: float) -> None:
    best, lower, upper = likelihood_interval(
        lambda place: -((place - middle) ** 2) / (2 * width**2), GRID
    )
    assert best == pytest.approx(middle, abs=1e-5)  # a peak is flat: the root of rounding
    assert (lower, upper) == pytest.approx((middle - Z * width, middle + Z * width), abs=1e-8)


def test_an_interval_holds_every_likely_peak() -> None:
    def two_peaks(place: float) -> float:
        return float(np.logaddexp(-200 * (place - 2.5) ** 2, -1 - 200 * (place + 1.5) ** 2))

    best, lower, upper = likelihood_interval(two_peaks, np.linspace(-4, 4, 81))
    assert best == pytest.approx(2.5, abs=1e-5)
    # 200 x^2 = DROP, and DROP - 1 at the lower peak.
    assert lower == pytest.approx(-1.5 - np.sqrt((DROP - 1) / 200), abs=1e-8)
    assert upper == pytest.approx(2.5 + np.sqrt(DROP / 200), abs=1e-8)


def test_open_ends_are_those_of_the_grid() -> None:
    best, lower, upper = likelihood_interval(lambda place: place, GRID)
    assert best == upper == 4.0
    assert lower == pytest.approx(4.0 - DROP, abs=1e-8)
    assert likelihood_interval(lambda _: 0.0, GRID)[1:] == (-4.0, 4.0)
