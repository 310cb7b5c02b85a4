"""Names of columns: which of a file's is which of ours, whatever case, spaces and brackets."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mlci.recordings.recording import Layout, goal_columns
from mlci.recordings.table import Wants
from mlci.systems import System

STATES = "states"  # an array of all states, (K+1, n)
TRIALS = ("trial", "trial id", "episode", "episode index", "track", "track id", "trackId", "id")
TIMES = ("time", "timestamp", "t")  # names of time, the first that is there
GOAL = ("goal_lower", "goal_upper")
_BRACKETS = re.compile(r"\s*[\[(]\s*([^\[\]()]*?(?:\([^()]*\))?[^\[\]()]*?)\s*[\])]\s*$")


def header_unit(header: str) -> str | None:
    """The unit in the brackets at the end of a header, such as Angle [deg]; None without."""
    brackets = _BRACKETS.search(header)
    if brackets is None or brackets[1].isdigit() or not brackets[1]:
        return None  # x[0] is an entry of an array
    return brackets[1]


def plain_name(header: str) -> str:
    """A name without case, unit, comment marks, and what stands for a space."""
    bare = header if header_unit(header) is None else _BRACKETS.sub("", header)
    return re.sub(r"[\s_-]+", "_", bare.strip("%#\ufeff'\" \t").casefold()).strip("_")


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
    same = [i for i, header in enumerate(headers) if header.strip() == sought]
    if not same:
        same = [i for i, header in enumerate(headers) if plain_name(header) == plain_name(sought)]
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
    return lambda header: plain_name(header) in bare


def shortened(names: Sequence[str]) -> str:
    """The first few names."""
    return ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
