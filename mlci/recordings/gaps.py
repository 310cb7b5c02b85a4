"""Gaps in recordings: short ones are bridged, long ones refused."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pandas as pd

from mlci.spaces import Bools, Floats, StateSpace

Place = Callable[[int, str], str]  # where a row of a frame, and a column, stand in the file


def bridge_gaps(
    frame: pd.DataFrame, space: StateSpace, most: Floats, place: Place
) -> tuple[pd.DataFrame, list[str]]:
    """A trial without gaps, and what was done about them.

    Rows at its ends that lack a state are left out. A gap between is bridged by a straight line in
    time, the short way round, if the path hardly goes farther than allowed in it: at the speed that
    it has across the gap, or for as long just before or after.

    Args:
        frame: rows by their number in the file; `time` [s] and states, of which some may be absent.
        space: the state space.
        most: (n,) how far a path may go in a gap [unit of x].
        place: names a row and column of the file.

    Raises:
        ValueError: a state that has no value at all, or a gap that is too long.
    """
    names = [name for name in space.names if name in frame]
    for name in names:
        if not frame[name].notna().any():
            raise ValueError(f"column {name!r} has no number")
    whole = np.flatnonzero(frame[names].notna().all(axis=1))
    if not len(whole):
        raise ValueError(f"no row has a number for each of {', '.join(names)}")
    kept = frame.iloc[whole[0] : whole[-1] + 1].copy()
    notes = []
    if left_out := len(frame) - len(kept):
        notes.append(f"{left_out} rows at the ends lack a state and are left out")
    for d, name in enumerate(space.names):
        if name in names and (gaps := _runs(kept[name].isna().to_numpy())):
            kept[name] = _bridged(kept, space, d, gaps, float(most[d]), place)
            count = sum(last - first + 1 for first, last in gaps)
            first = place(kept.index[gaps[0][0]], name)
            notes.append(f"{count} missing values of {name} are bridged ({first} first)")
    return kept, notes


def _bridged(
    frame: pd.DataFrame,
    space: StateSpace,
    d: int,
    gaps: list[tuple[int, int]],
    most: float,
    place: Place,
) -> Floats:
    """A column with its gaps filled; `most` [unit of x] is the farthest that the path may go."""
    name, time = space.names[d], frame["time"].to_numpy(dtype=float)
    values = frame[name].to_numpy(dtype=float, copy=True)
    known = np.flatnonzero(np.isfinite(values))
    for first, last in gaps:
        before, after, size = first - 1, last + 1, last - first + 1
        lasts, step = time[after] - time[before], _step(space, d, values[before], values[after])
        moves = [abs(step)]
        for side in (known[known <= before][-size - 1 :], known[known >= after][: size + 1]):
            if len(side) > 1:
                beside = sum(_step(space, d, *values[[i, j]]) for i, j in pairwise(side))
                moves.append(abs(beside) * lasts / (time[side[-1]] - time[side[0]]))
        if not (most > 0 and max(moves) <= most):
            rows = [place(frame.index[row], name) for row in (first, last)]
            raise ValueError(
                f"{' to '.join(dict.fromkeys(rows))}: {name} is missing for {lasts:.3g} s, in "
                f"which it may move by {max(moves):.2g} {space.units[d]}, more than {most:.2g}: "
                "fill the gap, or allow longer ones by bridge (a share of a cell)"
            )
        share = (time[first:after] - time[before]) / lasts
        values[first:after] = values[before] + share * step
    return values


def _step(space: StateSpace, d: int, start: float, end: float) -> float:
    """From one value of a dimension to another, the short way round."""
    offset = np.where(np.arange(space.dimension) == d, end - start, 0.0)
    return float(space.difference(offset, np.zeros(space.dimension))[d])


def _runs(missing: Bools) -> list[tuple[int, int]]:
    """First and last number of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(int)))
    return [(int(first), int(last) - 1) for first, last in edges.reshape(-1, 2)]
