"""Files of several trials, in the forms that people have them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mlci.recordings.recording import Recording
from mlci.recordings.table import Table
from mlci.recordings.trials import split_trials


def recording(columns: dict[str, object], keep: tuple[str, ...] = ()) -> Recording:
    """A file with a header, whose first line of numbers is the second."""
    table = pd.DataFrame(columns)
    lines = np.arange(len(table)) + 2
    frame = table[["time", "angle", *keep]]
    return Recording(Table(Path("all.csv"), table, lines=lines), frame)


def rows(time: list[float], **more: object) -> dict[str, object]:
    return {"time": np.array(time, dtype=float), "angle": np.arange(len(time)) * 0.1, **more}


def sizes(found: Recording, *group_by: str) -> dict[str, int]:
    return {trial.name: len(trial.frame) for trial in split_trials(found, group_by)[0]}


ONCE = [0.0, 0.1, 0.2, 0.3]


def test_a_file_of_one_trial_stays_one() -> None:
    assert split_trials(recording(rows(ONCE)), ())[1] == []
    assert sizes(recording(rows(ONCE))) == {"": 4}
    assert sizes(recording(rows([5.0, 7.5, 9.0]))) == {"": 3}


def test_time_that_starts_again_starts_another_trial() -> None:
    found = recording(rows([*ONCE, *ONCE, *ONCE[:3]]))
    trials, notes = split_trials(found, ())
    assert [(each.name, each.frame.index[0]) for each in trials] == [("1", 0), ("2", 4), ("3", 8)]
    assert notes == ["time starts again at line 6, line 10: 3 trials"]
    # A later trial may start later than the first did, or before it.
    assert sizes(recording(rows([1.0, 2.0, 3.0, 1.2, 2.0, 3.0, 0.5, 1.0, 2.0]))) == {
        "1": 3,
        "2": 3,
        "3": 3,
    }


def test_trials_are_named_by_a_column_that_changes_with_them() -> None:
    found = recording(rows(ONCE * 2, subject="S1", episode=[4.0] * 4 + [7.0] * 4, k=range(8)))
    assert sizes(found) == {"4": 4, "7": 4}
    assert split_trials(found, ())[1] == [
        "time starts again at line 6: 2 trials, named by column 'episode'"
    ]


def test_columns_name_trials_that_interleave() -> None:
    interleaved = {"run": ["a", "b"] * 4, "person": [1, 1, 1, 1, 2, 2, 2, 2]}
    time = [0, 0, 0.1, 0.1, 0, 0, 0.1, 0.1]
    found = recording(rows(time, **interleaved), ("person", "run"))
    assert sizes(found, "person", "run") == {"1_a": 2, "1_b": 2, "2_a": 2, "2_b": 2}
    trials, notes = split_trials(found, ["person", "run"])
    assert trials[1].frame.index.tolist() == [1, 3]
    assert notes == ["4 trials by person and run"]
    assert sizes(found, "run") == {"a_1": 2, "a_2": 2, "b_1": 2, "b_2": 2}


def test_rows_that_name_no_trial_are_left_out() -> None:
    found = recording(rows(ONCE * 2, run=["a"] * 4 + [None] + ["b"] * 3), ("run",))
    assert sizes(found, "run") == {"a": 4, "b": 3}
    assert split_trials(found, ["run"])[1][0] == "1 rows without run are left out"
    nothing = recording(rows(ONCE, run=[np.nan] * 4), ("run",))
    with pytest.raises(ValueError, match="no row with a value of run"):
        split_trials(nothing, ["run"])


def test_trials_that_interleave_are_refused_with_the_column_that_names_them() -> None:
    time = np.repeat(ONCE * 2, 2)
    found = recording(rows(time.tolist()[:8], car=[1, 2] * 4, speed=np.linspace(0, 1, 8)))
    with pytest.raises(ValueError, match=r"line 3: time goes forth and back.*group_by=car"):
        split_trials(found, ())
    in_pairs = [10, 10.1, 0, 0.1, 10.2, 10.3, 0.2, 0.3]
    found = recording(rows(in_pairs, car=[1, 1, 2, 2, 1, 1, 2, 2]))
    with pytest.raises(ValueError, match=r"line 4: .*group_by=car would tell 2 trials apart"):
        split_trials(found, ())
    unnamed = recording(rows([0.0, 0.05, 0.01, 0.06, 0.02, 0.07]))
    with pytest.raises(ValueError, match=r"line 4: .*group_by=COLUMN"):
        split_trials(unnamed, ())


def test_a_small_step_back_is_left_to_who_needs_rising_times() -> None:
    assert sizes(recording(rows([0.0, 0.1, 0.2, 0.19, 0.3, 0.4]))) == {"": 6}


def test_a_column_that_says_so_names_trials_although_time_goes_on() -> None:
    time = (np.arange(9) / 10).tolist()
    beside = {"phase": [1, 1, 1, 2, 3, 3, 3, 3, 3]}
    found = recording(rows(time, trial=[1.0] * 3 + [2.0] * 3 + [3.0] * 3, **beside))
    assert sizes(found) == {"1": 3, "2": 3, "3": 3}
    assert split_trials(found, ())[1] == ["3 trials by trial"]
    found = recording(rows(time, subject_trial=[1] * 4 + [2] * 5))
    assert sizes(found) == {"": 9}
    interleaved = recording(rows(time, track_id=[1, 2, 3] * 3))
    assert sizes(interleaved) == {"1": 3, "2": 3, "3": 3}


def test_time_that_runs_backwards_or_stands_still_is_named_as_that() -> None:
    with pytest.raises(ValueError, match="line 3: time runs backwards in the whole file: sort"):
        split_trials(recording(rows([0.3, 0.2, 0.1, 0.0])), ())
    with pytest.raises(ValueError, match="line 3: time stands still in 3 of 5 steps"):
        split_trials(recording(rows([0, 0, 1, 1, 2, 2])), ())
