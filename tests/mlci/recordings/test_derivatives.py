"""Smooth derivatives against those that are known."""

import numpy as np
import pandas as pd
import pytest

from mlci.recordings.derivatives import derive, smooth_derivative
from mlci.systems import Pendulum

SPACE = Pendulum().space
TIME = np.arange(301) / 100


def test_the_derivative_of_a_cubic_is_exact_at_even_times() -> None:
    values = 2 - TIME + 0.5 * TIME**2 - 0.1 * TIME**3
    slope = smooth_derivative(values, TIME, 0.2)
    np.testing.assert_allclose(slope, -1 + TIME - 0.3 * TIME**2, atol=1e-9)


def test_an_angle_is_unwrapped_before() -> None:
    angle = 5 + 2 * TIME + 0.5 * np.sin(TIME)  # twice round
    frame = pd.DataFrame({"time": TIME, "angle": angle % (2 * np.pi)})
    found = derive(frame, SPACE, {"angular_velocity": "angle"}, 0.2)
    np.testing.assert_allclose(found["angular_velocity"], 2 + 0.5 * np.cos(TIME), atol=1e-5)
    assert "angular_velocity" not in frame


def test_uneven_times_are_interpolated() -> None:
    rng = np.random.default_rng(0)
    time = np.sort(rng.choice(TIME, 200, replace=False))
    slope = smooth_derivative(np.sin(2 * time), time, 0.3)
    np.testing.assert_allclose(slope, 2 * np.cos(2 * time), atol=0.06)


def test_noise_becomes_less_in_a_wider_window() -> None:
    noisy = np.sin(TIME) + np.random.default_rng(0).normal(0, 0.01, len(TIME))
    off = [np.std(smooth_derivative(noisy, TIME, width) - np.cos(TIME)) for width in (0.1, 0.5)]
    assert off[1] < 0.15 * off[0]


@pytest.mark.parametrize(
    ("time", "window", "message"),
    [
        (TIME[:4], 0.2, "has 4 samples; a derivative needs at least 5"),
        (TIME, 0.03, r"3 samples in a window of 0.03 s, 0.01 s apart.*derive_window=0.04 or more"),
        (TIME[:11], 0.2, "lasts 0.1 s, less than derive_window=0.2"),
    ],
)
def test_what_is_too_short_is_refused(time: np.ndarray, window: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        smooth_derivative(np.sin(time), time, window)


def test_the_suggested_window_is_enough() -> None:
    assert len(smooth_derivative(np.sin(TIME), TIME, 0.04)) == len(TIME)


def test_a_state_that_is_not_there_has_no_derivative() -> None:
    frame = pd.DataFrame({"time": TIME})
    with pytest.raises(ValueError, match="has no column angle to derive from"):
        derive(frame, SPACE, {"angular_velocity": "angle"}, 0.2)
