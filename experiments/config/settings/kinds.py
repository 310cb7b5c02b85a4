"""Kinds of values that fields share: numbers with their ranges, words, and lists of them."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, ConfigDict, Discriminator, Field, Tag
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from mlci.region_sizes import LARGEST_POWER

STRICT = ConfigDict(extra="forbid", defer_build=True)  # a key that no field has is an error

MULTIPLE_OF_PI = (
    r"\s*([+-]?)\s*(?:(\d+(?:\.\d+)?)(?:\s*/\s*(\d+))?)?\s*\*?\s*pi\s*(?:/\s*(\d+))?\s*"
)


def about(meaning: str, unit: str = "") -> FieldInfo:
    """What a field means and its unit, for the tables of conf/README.md and for editors."""
    info: FieldInfo = Field(description=meaning, json_schema_extra={"unit": unit} if unit else None)
    return info


def read_number(value: Any) -> float:
    """A finite number, or a multiple of pi in words: "6/5 pi", "-pi/2"."""
    try:
        if isinstance(value, str) and (match := re.fullmatch(MULTIPLE_OF_PI, value)):
            sign, factor, divisor, end = match.groups()
            size = float(factor or 1) / float(divisor or 1) / float(end or 1) * math.pi
            number = -size if sign == "-" else size
        elif isinstance(value, int | float) and not isinstance(value, bool):
            number = float(value)
        else:
            number = math.nan
    except (ZeroDivisionError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise PydanticCustomError("number_type", "")
    return number + 0.0  # -0.0 is 0.0: one spelling for equal numbers


_READ = BeforeValidator(read_number)
Number = Annotated[float, _READ]
Positive = Annotated[float, Field(gt=0), _READ]
NotNegative = Annotated[float, Field(ge=0), _READ]
Weight = Annotated[float, Field(ge=0, le=1e6), _READ]  # [nat/s] or [nat]; a wall is far below
LogOdds = Annotated[float, Field(ge=-1e6, le=1e6), _READ]  # [nat]
Strength = Annotated[float, Field(ge=0.01, le=100), _READ]  # times a control range
SizePower = Annotated[float, Field(ge=0, le=LARGEST_POWER), _READ]
HalfWidth = Annotated[float, Field(gt=0, le=0.5), _READ]  # share of a range
Share = Annotated[float, Field(ge=0, lt=1), _READ]
DepthShare = Annotated[float, Field(ge=0, lt=0.5), _READ]
Probability = Annotated[float, Field(gt=0, lt=1), _READ]
Duration = Annotated[float, Field(gt=0, le=1e8), _READ]  # [s], up to three years

_MOST = 1_000_000  # of trials, rollouts and the like
Whole = Annotated[int, Field(strict=True)]
Index = Annotated[int, Field(strict=True, ge=0)]
Count = Annotated[int, Field(strict=True, ge=1, le=_MOST)]
StartPoints = Annotated[int, Field(strict=True, ge=1, le=20)]  # along each dimension of a cell
Tasks = Annotated[int, Field(strict=True, ge=1, le=10_000)]  # each is worked on for some 10 ms
Restarts = Annotated[int, Field(strict=True, ge=1, le=1000)]  # all are searched from at once
CountOrNone = Annotated[int, Field(strict=True, ge=0, le=_MOST)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=2**32)]

Flag = Annotated[bool, Field(strict=True)]
Word = Annotated[str, Field(strict=True)]
PathWord = Annotated[
    Word, BeforeValidator(lambda value: str(value) if type(value) is int else value)
]


def one_or_list(one: Any, several: Any) -> Any:
    """A kind that is either a single value or a list, told apart by the value's form."""
    choose = Discriminator(lambda value: LIST if isinstance(value, list | tuple) else ONE)
    return Annotated[Annotated[one, Tag(ONE)] | Annotated[several, Tag(LIST)], choose]


# They come into the place of an error, where they are no key.
ONE, LIST, WORD = "<one>", "<list>", "<word>"

ESTIMATE = "estimate"  # in place of a share
ShareOrEstimate = Annotated[
    Annotated[Share, Tag(ONE)] | Annotated[Literal["estimate"], Tag(WORD)],
    Discriminator(lambda value: WORD if value == ESTIMATE else ONE),
]

DRAWN = "drawn"  # in place of a number
IndexOrDrawn = Annotated[
    Annotated[Index, Tag(ONE)] | Annotated[Literal["drawn"], Tag(WORD)],
    Discriminator(lambda value: WORD if value == DRAWN else ONE),
]
