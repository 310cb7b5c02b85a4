"""Several trials in one file: columns name them, or time starts again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd

from mlci.recordings.columns import TRIALS, plain_name, shortened
from mlci.recordings.recording import Recording
from mlci.spaces import Floats, Ints

_BACK = 0.5  # of a trial so far: a step back in time of more starts another
_MOST_SHOWN = 8


@dataclass(frozen=True, eq=False)
class Trial:
    """The rows of one trial.

    Attributes:
        name: what tells it from the other trials of its file; "" where it is the only one.
        frame: its rows of `Recording.frame`, in the file's order.
    """

    name: str
    frame: pd.DataFrame


def split_trials(recording: Recording, group_by: Sequence[str]) -> tuple[list[Trial], list[str]]:
    """The trials of a file, and what was assumed to tell them apart.

    Args:
        recording: the file, whose frame has the columns of `group_by`.
        group_by: columns whose values name a trial together; with none, time that starts again
            starts another trial, or columns such as `trial` name them. Time that starts again does
            so within a trial of `group_by` as well.

    Raises:
        ValueError: time that goes forth and back, as where several trials interleave.
    """
    frame, notes = recording.frame, list[str]()
    if missing := [name for name in group_by if name not in frame]:
        others = shortened([*map(str, recording.table.columns.columns), *recording.table.others])
        raise ValueError(f"has no column {' or '.join(missing)} for group_by, but {others}")
    groups = [("", frame)]
    keys, named = _keys(recording, group_by)
    if keys is not None:
        unnamed = keys == ""
        if unnamed.any():
            notes.append(f"{int(unnamed.sum())} rows without {' or '.join(named)} are left out")
        names = pd.unique(keys[~unnamed])
        groups = [(name, frame[(keys == name).to_numpy()]) for name in names]
        if not groups:
            raise ValueError(f"has no row with a value of {' and '.join(named)}")
    trials = []
    for name, rows in groups:
        parts = _parts(rows, fewest=2 if named else 3)
        if len(parts) == 1:
            trials.append(Trial(name, rows))
            continue
        column = None if named else _naming_column(recording, parts)
        if not parts or not (named or column or not _id_columns(recording)):
            raise ValueError(_interleaved(recording, rows, is_grouped=bool(group_by)))
        labels = [str(number + 1) for number in range(len(parts))]
        if column is not None:
            labels = [_text(recording.table.columns[column].loc[part.index[0]]) for part in parts]
        trials += [
            Trial("_".join(filter(None, [name, label])), part)
            for label, part in zip(labels, parts, strict=True)
        ]
        places = _shown([recording.place(part.index[0], "time") for part in parts[1:]])
        by = "" if column is None else f", named by column {column!r}"
        notes.append(f"time starts again at {places}: {len(parts)} trials{by}")
    if named and len(trials) > 1:
        notes.append(f"{len(trials)} trials by {' and '.join(named)}")
    return trials, notes


def _keys(
    recording: Recording, group_by: Sequence[str]
) -> tuple[pd.Series[str] | None, Sequence[str]]:
    """What names the trial of each row, and the columns that this is made of.

    Where time never starts again and none are given, they are those whose names say so.
    """
    if group_by:
        return _texts(recording.frame, group_by), group_by
    columns = recording.table.columns
    if recording.table.header and len(_parts(recording.frame, fewest=3)) == 1:
        known = {plain_name(name) for name in TRIALS}
        named = [name for name in columns.columns if plain_name(str(name)) in known]
        if named := _id_columns(recording, named):
            return _texts(columns, named), named
    return None, ()


def _parts(rows: pd.DataFrame, fewest: int) -> list[pd.DataFrame]:
    """The rows of a trial, or of several where time starts again; none where that is unclear."""
    starts = _restarts(rows["time"].to_numpy(dtype=float), fewest)
    if starts is None:
        return []
    edges = [*starts.tolist(), len(rows)]
    return [rows.iloc[first:last] for first, last in pairwise(edges)]


def _interleaved(recording: Recording, rows: pd.DataFrame, *, is_grouped: bool) -> str:
    """What is wrong with time that goes forth and back, and which column may help."""
    time = rows["time"].dropna()
    steps = np.diff(time)
    place = recording.place(time.index[1:][(steps <= 0)][0], "time")
    if np.all(steps <= 0) and np.any(steps < 0):
        return f"{place}: time runs backwards in the whole file: sort its samples by time"
    hint = "group_by=COLUMN tells trials apart, by a column that names them"
    if not is_grouped and (columns := _id_columns(recording)):
        count = recording.table.columns[columns[0]].nunique()
        hint = f"group_by={columns[0]} would tell {count} trials apart"
    elif np.all(steps >= 0):
        return (
            f"{place}: time stands still in {int(np.sum(steps == 0))} of {len(steps)} steps, as "
            "where it was rounded: write it with more digits, or leave repeated samples out"
        )
    return f"{place}: time goes forth and back, as where several trials interleave: {hint}"


def _restarts(time: Floats, fewest: int) -> Ints | None:
    """Numbers of the samples at which a trial starts, the first among them; None if it is unclear.

    One small step back is left in its trial: whoever needs rising times names it. Trials of fewer
    samples than `fewest`, in the median, are none.
    """
    known = np.flatnonzero(np.isfinite(time))
    starts, begin, latest, small = [0], np.nan, -np.inf, 0
    for k, moment in zip(known.tolist(), time[known].tolist(), strict=True):
        if np.isnan(begin):
            begin = moment
        elif moment <= latest:
            if latest > begin and latest - moment > _BACK * (latest - begin):
                starts.append(k)
                begin, latest = moment, -np.inf
            else:
                small += 1
        latest = max(latest, moment)
    sizes = np.diff([*starts, len(time)])
    if small > 1 or (len(starts) > 1 and np.median(sizes) < fewest):
        return None
    return np.array(starts)


def _naming_column(recording: Recording, parts: Sequence[pd.DataFrame]) -> str | None:
    """A column of the file with one value in each part, and another in each."""
    columns = recording.table.columns
    for name in columns.columns[columns.columns.is_unique * np.ones(columns.shape[1], bool)]:
        texts = [_texts(columns.loc[part.index], [name]) for part in parts]
        values = [text.iloc[0] for text in texts]
        if len(set(values)) == len(parts) and all(len(set(text)) == 1 for text in texts):
            return str(name)
    return None


def _id_columns(recording: Recording, names: Sequence[str] | None = None) -> list[str]:
    """Columns of the file, or those of some names, within whose values time rises."""
    columns, time = recording.table.columns, recording.frame["time"]
    found = []
    for name in pd.unique(columns.columns if names is None else pd.Index(names)):
        values = columns[name]
        if isinstance(values, pd.DataFrame) or not _is_whole(values):
            continue
        keys = _texts(columns, [name])
        if not 1 < keys.nunique() <= len(keys) / 3:
            continue
        steps = time.groupby(keys.to_numpy()).diff().dropna()
        if np.all(steps > 0):
            found.append(str(name))
    return found


def _is_whole(values: pd.Series[float]) -> bool:
    """Whether values may be names: no fractions, no times."""
    if values.dtype.kind == "f":
        return bool(np.all(values.dropna() % 1 == 0))
    return values.dtype.kind not in "cmM"


def _texts(frame: pd.DataFrame, names: Sequence[str]) -> pd.Series[str]:
    """The values of some columns in a row, joined; "" where one is missing."""
    parts = [frame[name].map(_text) for name in names]
    joined = parts[0]
    for part in parts[1:]:
        joined = (joined + "_" + part).where((joined != "") & (part != ""), "")
    return joined


def _text(value: object) -> str:
    """A value as part of a trial's name: 3 for 3.0, "" for a missing one."""
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.12g}"
    return "" if value is None or value is pd.NA or value is pd.NaT else str(value).strip()


def _shown(places: Sequence[str]) -> str:
    """The first few places."""
    more = len(places) - _MOST_SHOWN
    return ", ".join(places[:_MOST_SHOWN]) + (f" and {more} more" if more > 0 else "")
