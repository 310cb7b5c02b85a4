"""Numbers as a config may write them, and kinds that take one value or several."""

import math
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from experiments.config.settings.kinds import Count, Flag, Number, Whole, Word, one_or_list


@pytest.mark.parametrize(
    ("words", "value"),
    [
        ("pi", 1),
        ("6/5 pi", 1.2),
        ("-pi/2", -0.5),
        ("2pi", 2),
        ("1.5 * pi", 1.5),
        ("-3/4 pi", -0.75),
    ],
)
def test_multiples_of_pi_in_words(words: str, value: float) -> None:
    number = TypeAdapter(Number).validate_python(words)
    assert number == pytest.approx(value * math.pi, rel=1e-15)


def test_whole_numbers_are_numbers_too() -> None:
    number = TypeAdapter(Number).validate_python(1)
    assert (number, type(number)) == (1.0, float)


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        *((Number, value) for value in (True, "1", "pi/0", "9" * 400 + " pi", None, [1.0])),
        *((Number, value) for value in (math.nan, math.inf, 10**400)),
        *((Whole, value) for value in (True, 1.0, "1", None)),
        *((Flag, value) for value in (1, "true", None)),
        *((Word, value) for value in (1, True, None)),
    ],
)
def test_nothing_is_taken_for_what_it_is_not(kind: Any, value: Any) -> None:
    with pytest.raises(ValidationError):
        TypeAdapter(kind).validate_python(value)


def test_one_value_or_several() -> None:
    kind = TypeAdapter(one_or_list(Count, tuple[Count, ...]))
    assert kind.validate_python(3) == 3
    assert kind.validate_python([3, 4]) == (3, 4)
    for wrong, place in ((0, ()), ([3, 0], (1,))):
        with pytest.raises(ValidationError) as error:
            kind.validate_python(wrong)
        assert error.value.errors()[0]["loc"][1:] == place  # and no error of the other kind
        assert error.value.error_count() == 1
