"""Names of columns: which of a file's is which of ours, whatever case, spaces and brackets."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from functools import lru_cache

from mlci.recordings.recording import Layout, goal_columns
from mlci.recordings.table import Wants
from mlci.systems import System

STATES = "states"  # an array of all states, (K+1, n)
# Names of columns that name trials.
TRIALS = (
    *("trial", "trial id", "episode", "episode index", "track", "track id", "trackId", "id"),
    *("demonstration", "trajectory", "trajectory id", "rollout"),
)
TIMES = ("time", "timestamp", "t")  # names of time, the first that is there
GOAL = ("goal_lower", "goal_upper")
_WORDS = {
    "deg": "deg degree degrees °",
    "rad": "rad radian radians",
    "deg/s": "deg_s deg_sec deg_per_s deg_per_sec degrees_s degrees_per_second degps dps °_s",
    "rad/s": "rad_s rad_sec rad_per_s rad_per_sec radians_s radians_per_second radps",
    "rpm": "rpm rev_min",
    "s": "s sec secs second seconds",
    "ms": "ms msec msecs millis millisecond milliseconds",
    "us": "us usec μs microsecond microseconds",
    "ns": "ns nsec nanosecond nanoseconds",
    "m": "m",
    "cm": "cm",
    "mm": "mm",
    "m/s": "m_s m_per_s mps",
    "mm/s": "mm_s mm_per_s",
}
# Units by the words that end a header, with _ for what is no letter.
_UNITS = {word: unit for unit, words in _WORDS.items() for word in words.split()}
_BRACKETS = re.compile(r"\s*[\[(]\s*([^\[\]()]*?(?:\([^()]*\))?[^\[\]()]*?)\s*[\])]\s*$")


def header_unit(header: str) -> str | None:
    """The unit in the brackets at the end of a header, such as Angle [deg]; None without."""
    brackets = _BRACKETS.search(header)
    if brackets is None or brackets[1].isdigit() or not brackets[1]:
        return None  # x[0] is an entry of an array
    return brackets[1]


def trailing_unit(header: str) -> tuple[str, str | None]:
    """A header without the unit that ends it as a word, and that unit, None without.

    As in theta_deg, time_ms, Time,s, angle / rad and omega rad s^-1.
    """
    for gap in re.finditer(r"(?<=\w)[\s_,;./-]+", header):
        rest = re.sub(r"\^?-1\b", "", header[gap.end() :].casefold())
        word = re.sub(r"[^a-z°μ]+", "_", rest).strip("_")
        if word in _UNITS and not re.search(r"\d", rest):
            return header[: gap.start()], _UNITS[word]
    return header, None


def plain_name(header: str) -> str:
    """A name without case, unit, comment marks, and what stands for a space."""
    bare = header if header_unit(header) is None else _BRACKETS.sub("", header)
    bare = unicodedata.normalize("NFC", bare).strip("%#\ufeff'\" \t").casefold()
    return re.sub(r"[\s_-]+", "_", bare.rstrip("/ ")).strip("_")


@lru_cache(100_000)
def _readings(header: str) -> tuple[str, ...]:
    """What a header may be the name of, the nearest first: as it is, plain, without the unit that
    ends it, and the last of names joined by dots."""
    last = header.rpartition(".")[2]
    names = (header, trailing_unit(header)[0], last, trailing_unit(last)[0])
    return header.strip(), *map(plain_name, names)


def position(name: str, headers: Sequence[str], given: str | None = None) -> int | None:
    """Where the column of a name stands; None where it does not.

    Args:
        name: ours.
        headers: the names of a file's columns.
        given: the file's name for it, where the user says so.

    Raises:
        ValueError: several columns have the name.
    """
    sought = name if given is None else given
    forms, same = (sought, *[plain_name(sought)] * 4), list[int]()
    for level, form in enumerate(forms):
        same = same or [i for i, header in enumerate(headers) if _readings(header)[level] == form]
    if len(same) > 1:
        alike = [headers[i].strip() for i in same]
        remedy = "rename or remove all but one"
        if len(set(alike)) > 1:
            remedy = f"name the one to use, as in columns={{{name}: '{alike[0]}'}}"
        raise ValueError(f"has {len(same)} columns {sought!r} ({', '.join(alike)}): {remedy}")
    return same[0] if same else None


def control_columns(system: System) -> list[str]:
    """Names of the columns of controls."""
    return [f"control_{i + 1}" for i in range(system.control_box.dimension)]


def wanted(system: System, layout: Layout) -> Wants:
    """Which arrays of a file are loaded: those that may be used."""
    names = {
        *TIMES,
        *TRIALS,
        "dt",
        STATES,
        "controls",
        *GOAL,
        *system.space.names,
        *control_columns(system),
        *goal_columns(system.space),
        *layout.columns.values(),
        *layout.keep,
    }
    bare = {plain_name(re.sub(r"\[\d+\]$", "", name)) for name in names}
    return lambda header: not bare.isdisjoint(_readings(header)[1:])


def shortened(names: Sequence[str]) -> str:
    """The first few names."""
    return ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
