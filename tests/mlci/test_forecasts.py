"""The map of forecasts against its formula, a slower solver, and a map that made the data."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.optimize import minimize

from mlci.forecasts import ForecastCurve, ForecastMap, fit_map
from mlci.region_sizes import region_sizes
from mlci.regions import Regions
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import Pendulum

SIZE = (0.01, 0.01)
CURVE = ForecastCurve(SIZE, 200, 1000, -1.0, 0.2, 1.5, 0.8)
SHARP = ForecastCurve((0.04, 0.09), 200, 1000, 0.0, 1.0, 1.0, 0.9)
RNG_SEED = 3


def crossing(curve: ForecastCurve, phi: float) -> float:
    """The formula at the head of the module, a number at a time."""
    gain = min(-math.log(1 - phi), math.log(curve.tasks + 1)) if phi < 1 else math.log(201)
    log_odds = curve.intercept + curve.of_probability * math.log(phi) + curve.of_gain * gain
    return curve.ceiling / (1 + math.exp(-log_odds))


def test_curve_is_its_formula() -> None:
    phi = np.array([1e-6, 0.01, 0.3, 0.5, 0.9, 0.999, 1.0])
    assert 1 - CURVE.avoidance(1 - phi) == pytest.approx([crossing(CURVE, p) for p in phi])


def test_what_is_out_of_reach_stays_so() -> None:
    assert CURVE.avoidance([1.0, 1 - 1e-15]).tolist() == [1.0, 1.0]
    assert CURVE.avoidance([1 - 1e-9])[0] < 0.999


def test_parameters_of_no_change_leave_phi_up_to_the_ceiling() -> None:
    same = ForecastCurve(SIZE, 1000, 1000, 0.0, 1.0, 1.0, 1 - 1 / 1001)
    phi = np.linspace(0.01, 0.98, 20)
    assert 1 - same.avoidance(1 - phi) == pytest.approx(phi * (1 - 1 / 1001), rel=1e-12)


def test_map_is_monotone_and_bounded() -> None:
    alpha = np.concatenate([[0.0, 1e-30, 1e-5], np.linspace(0.001, 1, 500)])
    calibrated = CURVE.avoidance(alpha)
    assert np.all(np.diff(calibrated) >= 0)
    assert calibrated.min() >= 1 - CURVE.ceiling
    assert pytest.approx(math.log(5)) == CURVE.largest_gain


def test_regions_use_the_curve_of_the_nearest_size() -> None:
    both = ForecastMap((CURVE, SHARP))
    sizes = [0.001, 0.01, 0.019, 0.021, 0.05, 0.09, 1.0, 0.0]
    assert both.curve_numbers(sizes).tolist() == [0, 0, 0, 1, 1, 1, 1, 0]
    alpha = np.array([[0.3, 0.3, 1.0], [0.0, 0.5, 0.5]])
    expected = np.stack(
        [CURVE.avoidance(alpha[:, 0]), SHARP.avoidance(alpha[:, 1]), CURVE.avoidance(alpha[:, 2])],
        axis=1,
    )
    assert np.array_equal(both.avoidance(alpha, [0.01, 0.06, 0.01]), expected)
    assert both.largest_gain == SHARP.largest_gain


@pytest.mark.parametrize("wrong", [(-1.0, 1.0, 0.5), (1.0, -1.0, 0.5), (1.0, 1.0, 0.996)])
def test_a_curve_that_cannot_be_is_refused(wrong: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match=r"must not fall|do not allow a ceiling of 0\.996"):
        ForecastCurve(SIZE, 200, 10, 0.0, *wrong)


def drawn(curve: ForecastCurve, tasks: int, regions: int) -> tuple[Floats, Floats]:
    """Forecasts of many sizes, and what happens with the probability that the curve says."""
    rng = np.random.default_rng(RNG_SEED)
    alpha = 1 - np.exp(-rng.exponential(2.0, (tasks, regions)))
    alpha[rng.random(alpha.shape) < 0.1] = 0.0
    return alpha, rng.random(alpha.shape) < 1 - curve.avoidance(alpha)


def test_a_known_map_is_recovered() -> None:
    """From 40 000 pairs, calibrated probabilities are right within some standard errors."""
    alpha, crossed = drawn(CURVE, 200, 200)
    fitted = fit_map(alpha, crossed, np.full(200, 0.01)).curves[0]
    phi = np.array([0.001, 0.01, 0.1, 0.3, 0.6, 0.9, 1.0])
    assert fitted.avoidance(1 - phi) == pytest.approx(CURVE.avoidance(1 - phi), abs=0.02)
    assert (fitted.tasks, fitted.pairs) == (200, 40_000)


def test_fit_has_the_best_score_with_the_priors_task() -> None:
    """No other parameters that a solver without gradients finds are better."""
    alpha, crossed = drawn(CURVE, 30, 20)
    fitted = fit_map(alpha, crossed, np.full(20, 0.01)).curves[0]

    def loss(parts: Floats) -> float:
        if min(parts[1], parts[2], parts[3]) < 0 or parts[3] > 1 - 1 / 31:
            return math.inf
        curve = ForecastCurve(SIZE, 30, 1, *map(float, parts))
        q = 1 - curve.avoidance(alpha)
        of_task = (1 - alpha) * np.log(q) + alpha * np.log(1 - q)
        return -float(np.sum(np.where(crossed, np.log(q), np.log(1 - q)) + of_task / 30))

    best = [fitted.intercept, fitted.of_probability, fitted.of_gain, fitted.ceiling]
    starts = itertools.product([-1.0], [0.2, 1.0], [0.5, 1.5], [0.5, 0.9])
    others = [minimize(loss, start, method="Nelder-Mead").fun for start in starts]
    # 600 pairs: a loss of some 300 nat, of which Nelder-Mead leaves its tolerance of 1e-4.
    assert loss(np.array(best)) <= min(others) + 1e-3


def test_no_demonstrations_make_a_gain_infinite() -> None:
    """Whatever the model calls certain comes true in 20 of 20 tasks: log 21 nat at most."""
    alpha = np.tile([0.0, 0.5], (20, 10))
    fitted = fit_map(alpha, alpha == 0, np.full(20, 0.01))
    assert fitted.largest_gain == pytest.approx(math.log(21))
    assert np.all(fitted.avoidance(alpha, np.full(20, 0.01)) >= (1 - 1e-12) / 21)


def test_pairs_that_do_not_count_and_those_out_of_reach_change_nothing() -> None:
    alpha, crossed = drawn(CURVE, 40, 10)
    sizes = np.full(10, 0.01)
    alone = fit_map(alpha[:, :6], crossed[:, :6], sizes[:6])
    counts = np.tile(np.arange(10) < 8, (40, 1))
    counts[:, 6:8] = True
    alpha[:, 6:8], crossed[:, 8:] = 1.0, True
    assert fit_map(alpha, crossed, sizes, counts) == alone


def test_regions_of_other_sizes_have_curves_of_their_own() -> None:
    alpha, crossed = drawn(CURVE, 40, 12)
    sizes = np.array([0.01] * 4 + [0.02] * 4 + [0.021] * 4)
    both = fit_map(alpha, crossed, sizes)
    assert [curve.sizes for curve in both.curves] == [(0.01, 0.02), (0.021, 0.021)]
    assert both.curves[1] == fit_map(alpha[:, 8:], crossed[:, 8:], sizes[8:]).curves[0]


def test_a_size_with_few_pairs_joins_the_next() -> None:
    alpha, crossed = drawn(CURVE, 40, 3)
    for sizes in ([0.01, 0.01, 0.09], [0.01, 0.09, 0.09]):
        (curve,) = fit_map(alpha, crossed, np.array(sizes)).curves
        assert (curve.sizes, curve.pairs) == ((0.01, 0.09), 120)


def test_sizes_are_shares_of_the_space() -> None:
    space = Pendulum().space
    assert region_sizes(Regions.from_grid(space, (10, 5))) == pytest.approx(1 / 50)
    assert region_sizes(Regions.from_grid(space, (4, None))) == pytest.approx(1 / 4)
    line = StateSpace(Box([0.0], [10.0]), [False], ("x",))
    half_outside = Regions.from_boxes(line, [Box([8.0], [14.0]), Box([11.0], [12.0])])
    assert region_sizes(half_outside).tolist() == pytest.approx([0.2, 0.0])
    round_twice = Regions.from_boxes(space, [Box([0.0, -6.0], [4 * np.pi, 6.0])])
    assert region_sizes(round_twice).tolist() == [1.0]


def test_nothing_to_fit_is_said() -> None:
    with pytest.raises(ValueError, match="nothing to fit"):
        fit_map(np.ones((3, 2)), np.zeros((3, 2)), np.ones(2))
    with pytest.raises(ValueError, match=r"2 regions need as many sizes, not \(3,\)"):
        fit_map(np.ones((3, 2)), np.zeros((3, 2)), np.ones(3))
    with pytest.raises(ValueError, match=r"not \(3, 2\) and \(2, 2\)"):
        fit_map(np.ones((3, 2)), np.zeros((2, 2)), np.ones(2))


def test_fifty_pairs_are_enough_for_a_curve_of_their_own() -> None:
    alpha, crossed = drawn(CURVE, 50, 2)
    alpha = np.minimum(alpha, 0.999)  # all within reach
    for tasks, expected in ((50, [(0.01, 0.01), (0.09, 0.09)]), (49, [(0.01, 0.09)])):
        fitted = fit_map(alpha[:tasks], crossed[:tasks], np.array([0.01, 0.09]))
        assert [curve.sizes for curve in fitted.curves] == expected
