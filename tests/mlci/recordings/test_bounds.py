"""States outside the state space, by rounding and truly."""

import numpy as np
import pytest

from mlci.recordings.bounds import clip_rounding
from mlci.systems import Pendulum

SPACE = Pendulum().space


def clip(states: list[list[float]]) -> tuple[np.ndarray, str]:
    return clip_rounding(np.array(states), SPACE, lambda row, name: f"line {row + 2}")


def test_rounding_is_clipped_and_said() -> None:
    states, note = clip([[1.0, 5.9], [9.0, 6.0005], [1.0, -6.001]])
    assert states.tolist() == [[1.0, 5.9], [9.0, 6.0], [1.0, -6.0]]
    assert note.startswith("2 samples are outside the state space by rounding")
    assert clip([[1.0, 5.9], [-8.0, 6.0]])[1] == ""


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (6.5, r"line 3: angular_velocity = 6.5 is outside .*; 1 of 2 samples\): widen its bounds"),
        (90.0, r"is it in degrees\? then units=\{angular_velocity: deg/s\}; else widen"),
        (900.0, r"1 of 2 samples\): widen its bounds"),
    ],
)
def test_what_is_truly_outside_is_refused(value: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        clip([[1.0, 0.0], [1.0, value]])
