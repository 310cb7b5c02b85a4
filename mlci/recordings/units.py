"""Units of recorded numbers, and their conversion to the system's own.

An angle counts as a dimension of its own, so that a frequency in Hz is not taken for rad/s, nor a
plain number for radians.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from mlci.spaces import Floats

# A product of units with powers of one digit: nothing that takes long to work out.
_FORM = re.compile(
    r"(1 ?/ ?)?[^\W\d]+([\^*]{0,2}[+-]?\d)?([ */]+[^\W\d]+([\^*]{0,2}[+-]?\d)?){0,5}"
)
_SYMBOLS = {"°": "deg", "µ": "u", "μ": "u", "·": "*", "²": "^2", "³": "^3", "⁻¹": "^-1"}
# Other spellings: s-1 for s^-1, rad.s^-1 for rad*s^-1, rev for revolution.
_SPELLINGS = (
    (re.compile(r"(?<=[^\W\d])-(?=\d)"), "^-"),
    (re.compile(r"(?<=[^\W\d])\.(?=[^\W\d])"), "*"),
    (re.compile(r"\brevs?\b", re.IGNORECASE), "revolution"),
)
_RADIANS = re.compile(r"\brad(ians?)?\b")


def converted(values: Floats, unit: str, own: str) -> Floats:
    """Values in another unit.

    Args:
        values: any shape.
        unit: theirs.
        own: the unit to convert to.

    Raises:
        ValueError: a unit that nobody knows, or two that measure different things.
    """
    if _plain(unit) == _plain(own):
        return values
    theirs, ours = _fitting(unit, own), _parsed(own)
    result: Floats = _registry().Quantity(values, theirs).to(ours).magnitude
    return result


def fits(unit: str, own: str) -> bool:
    """Whether a unit measures what another does."""
    try:
        return _plain(unit) == _plain(own) or _fitting(unit, own) is not None
    except ValueError:
        return False


def in_degrees(own: str) -> str:
    """A system's unit with degrees in place of radians."""
    return _RADIANS.sub("deg", own)


def _fitting(unit: str, own: str) -> Any:
    """A unit of pint that measures what `own` does, whatever its case: [DEG], [S]."""
    registry, ours = _registry(), _parsed(own)
    errors = list[ValueError]()
    for text in dict.fromkeys((unit, unit.casefold())):
        try:
            theirs = _parsed(text)
        except ValueError as error:
            errors.append(error)
            continue
        # Root units and not dimensions, of which an angle has none.
        if registry.get_root_units(theirs)[1] == registry.get_root_units(ours)[1]:
            return theirs
        errors.append(
            ValueError(f"the unit {unit!r} is none of what is measured in {own or 'numbers'!r}")
        )
    raise errors[0]


def _plain(unit: str) -> str:
    """A unit's text, with symbols spelt out."""
    for symbol, word in _SYMBOLS.items():
        unit = unit.replace(symbol, word)
    for spelling, usual in _SPELLINGS:
        unit = spelling.sub(usual, unit)
    return " ".join(unit.split())


def _parsed(unit: str) -> Any:
    """A unit of pint."""
    text = _plain(unit).strip()
    if text in ("", "1", "-"):
        return _registry().dimensionless
    try:
        if len(text) <= 40 and _FORM.fullmatch(text):
            return _registry().parse_units(text)
    except Exception:  # pint raises errors of many kinds, and AttributeError among them
        pass
    raise ValueError(f"there is no unit {unit!r}: write one such as deg, rad/s, mm or ms")


@cache
def _registry() -> Any:
    """The units that there are; slow to load, so only when something is to be converted."""
    import pint

    return pint.UnitRegistry()
