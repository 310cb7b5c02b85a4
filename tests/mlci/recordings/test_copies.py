"""Copies of recordings are seen, and what only looks alike is not."""

import numpy as np

from mlci.demonstrations import Demonstration
from mlci.recordings.copies import distinct
from mlci.systems import Pendulum

SPACE = Pendulum().space
TIME = np.arange(101) / 100
PATH = np.column_stack([1 + np.sin(TIME), np.cos(TIME)])


def named(name: str, path: np.ndarray = PATH, time: np.ndarray = TIME) -> Demonstration:
    return Demonstration.from_path(path, time, name=name)


def test_copies_count_once() -> None:
    other = PATH + np.array([0.0, 0.001])
    kept, copies = distinct(
        [
            named("a"),
            named("b", other),
            named("turned", PATH + np.array([2 * np.pi, 0.0])),
            named("rounded", np.round(PATH, 6)),
            named("slower", PATH, 2 * TIME),
            named("shorter", PATH[:50], TIME[:50]),
            named("again", other),
        ],
        SPACE,
    )
    assert [each.name for each in kept] == ["a", "b", "slower", "shorter"]
    assert copies == [("turned", "a"), ("rounded", "a"), ("again", "b")]


def test_none_of_none() -> None:
    assert distinct([], SPACE) == ([], [])


def test_times_of_copies_agree_to_a_share_of_the_duration() -> None:
    """A millionth of 1000 s is a thousandth of a second."""
    long = 1000 * TIME
    rounded, other = (np.append(0.0, long[1:] + by) for by in (5e-4, 2e-3))
    kept, copies = distinct(
        [named("a", time=long), named("rounded", time=rounded), named("other", time=other)], SPACE
    )
    assert [each.name for each in kept] == ["a", "other"]
    assert copies == [("rounded", "a")]
