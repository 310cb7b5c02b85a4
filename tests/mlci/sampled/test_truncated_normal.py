import numpy as np
import pytest

from mlci.sampled.truncated_normal import log_mass, mean_and_variance, quantile

BOUNDS = [(-1.0, 2.0), (0.3, 0.4), (-0.2, np.inf), (-np.inf, -1.0), (7.0, 9.0), (-12.0, -11.0)]


@pytest.mark.parametrize(("low", "high"), BOUNDS)
def test_quantiles_mass_and_moments_are_those_of_the_density(low, high):
    """Summed over a fine grid; the density is taken relative to its highest value."""
    points = np.linspace(max(low, -14.0), min(high, 14.0), 400_001)
    nearest = np.clip(0.0, low, high)
    density = np.exp((nearest**2 - np.square(points)) / 2)
    step = points[1] - points[0]
    below = np.append(0, np.cumsum((density[1:] + density[:-1]) / 2)) * step
    ends = np.full(20, low), np.full(20, high)
    share = np.linspace(0.01, 0.99, 20)
    exact = np.interp(share, below / below[-1], points)
    np.testing.assert_allclose(quantile(*ends, share), exact, rtol=1e-5, atol=1e-7)
    mass = np.log(below[-1]) - nearest**2 / 2 - np.log(2 * np.pi) / 2
    assert log_mass(*ends)[0] == pytest.approx(mass, rel=1e-7)
    mean, variance = mean_and_variance(*ends)
    weight = density / np.sum(density)
    assert mean[0] == pytest.approx(weight @ points, rel=1e-4)
    apart = np.square(points - weight @ points)
    assert variance[0] == pytest.approx(weight @ apart, rel=1e-3, abs=1e-9)


def test_without_bounds_it_is_the_normal_distribution():
    low, high = np.array([-np.inf]), np.array([np.inf])
    mean, variance = mean_and_variance(low, high)
    assert (mean[0], variance[0], log_mass(low, high)[0]) == (0, 1, 0)
    assert quantile(low, high, np.array([0.975]))[0] == pytest.approx(1.959964)


def test_far_from_all_numbers_bounds_still_hold():
    number = quantile(np.array([90.0]), np.array([91.0]), np.array([0.5]))
    assert 90 <= number[0] <= 91
    assert log_mass(np.array([90.0]), np.array([91.0]))[0] == pytest.approx(-4055.4, abs=0.1)
